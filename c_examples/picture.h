/* Pictures as PPM files: three bytes for each pixel, rows from the top. */
#ifndef PICTURE_H
#define PICTURE_H

#include <stddef.h>
#include <stdio.h>

/* Opens a file. Call it before long work, so that a wrong name fails at once. */
FILE *open_picture(const char *path);

/* Writes and closes the file. */
void write_picture(FILE *file, const char *path, int width, int height,
                   const unsigned char *pixels);

#endif
