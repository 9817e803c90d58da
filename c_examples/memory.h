/* Memory, or the end of the program. */
#ifndef MEMORY_H
#define MEMORY_H

#include <stddef.h>
#include <stdint.h>

/* What messages begin with: each program defines it. */
extern const char *const program_name;

/* Ends the program with a message. */
void fail(const char *format, ...);

/* Memory for so many elements. */
void *allocate(size_t count, size_t size);

/* Memory that starts at a multiple of HGRID_ALIGNMENT, and what to free. */
typedef struct {
    void *start;
    size_t bytes;
    void *allocation;
} region;

region allocate_region(uint64_t bytes);

#endif
