/* A triangle mesh for the ray tracer, from a formula or a file. */
#ifndef SCENE_H
#define SCENE_H

#include <stddef.h>
#include <stdint.h>

typedef struct {
    float (*positions)[3];
    size_t vertex_count;
    uint32_t (*indices)[3];
    size_t triangle_count;
} scene;

/* Makes the built-in scene (knot.c). */
scene make_knot(void);

/* Loads a mesh file (ply.c). Ends the program if it cannot be read. */
scene load_ply(const char *path);

/* Loads the file, or makes the built-in scene if there is none. */
static inline scene load_scene(const char *path)
{
    return path != NULL ? load_ply(path) : make_knot();
}

#endif
