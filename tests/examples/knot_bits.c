/* Writes the arrays of the built-in scene, for the test to compare bit by bit. */

#include "scene.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

void fail(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    exit(1);
}

void *allocate(size_t count, size_t size)
{
    void *memory = malloc(count * size);
    if (memory == NULL)
        fail("no memory");
    return memory;
}

int main(void)
{
    scene s = make_knot();
    fwrite(s.positions, sizeof *s.positions, s.vertex_count, stdout);
    fwrite(s.indices, sizeof *s.indices, s.triangle_count, stdout);
    free(s.positions);
    free(s.indices);
    return 0;
}
