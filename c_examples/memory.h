/* Allocations that end the program if they fail. */
#ifndef MEMORY_H
#define MEMORY_H

#include <stddef.h>
#include <stdint.h>

/* The beginning of messages; each program defines it. */
extern const char *const program_name;

/* Ends the program with a message. */
void fail(const char *format, ...);

/* Allocates memory for so many elements. */
void *allocate(size_t count, size_t size);

/* Memory that starts at a multiple of HGRID_ALIGNMENT, with the pointer to free. */
typedef struct {
    void *start;
    size_t bytes;
    void *allocation;
} region;

region allocate_region(uint64_t bytes);

#endif
