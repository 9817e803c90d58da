#include "memory.h"

#include <hgrid.h>

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

void fail(const char *format, ...)
{
    /* Written in one call, because other processes may write to the same terminal. */
    static char message[8192];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    fprintf(stderr, "%s: %s\n", program_name, message);
    exit(1);
}

void *allocate(size_t count, size_t size)
{
    void *memory = count <= SIZE_MAX / size ? malloc(count > 0 ? count * size : 1) : NULL;
    if (memory == NULL)
        fail("not enough memory for %lu times %lu bytes", (unsigned long)count,
             (unsigned long)size);
    return memory;
}

/* C99 has no aligned allocation: allocate a little more, and start at the next multiple. */
region allocate_region(uint64_t bytes)
{
    if (bytes > SIZE_MAX - HGRID_ALIGNMENT)
        fail("the grid does not fit into the address space");
    region r;
    r.bytes = (size_t)bytes;
    r.allocation = allocate(r.bytes + HGRID_ALIGNMENT, 1);
    const size_t misplaced = (uintptr_t)r.allocation % HGRID_ALIGNMENT;
    r.start = (unsigned char *)r.allocation + (HGRID_ALIGNMENT - misplaced) % HGRID_ALIGNMENT;
    return r;
}
