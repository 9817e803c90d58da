#include "picture.h"

#include "memory.h"

#include <errno.h>
#include <stdbool.h>
#include <string.h>

FILE *open_picture(const char *path)
{
    FILE *file = fopen(path, "wb");
    if (file == NULL)
        fail("%s: cannot be written: %s", path, strerror(errno));
    return file;
}

void write_picture(FILE *file, const char *path, int width, int height,
                   const unsigned char *pixels)
{
    const size_t bytes = 3 * (size_t)width * (size_t)height;
    const bool is_written = fprintf(file, "P6\n%d %d\n255\n", width, height) > 0 &&
                            fwrite(pixels, 1, bytes, file) == bytes;
    if (fclose(file) != 0 || !is_written)
        fail("%s: cannot be written to the end", path);
}
