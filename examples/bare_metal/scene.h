/* The scene of the programs in this folder: a hilly field of 2000 triangles, and a camera above it. It is
 * made of whole numbers, so that every compiler makes the same bits. */
#ifndef SCENE_H
#define SCENE_H

#include <hgrid.h>

enum { WIDE = 25, LONG = 40, TRIANGLES = 2 * WIDE * LONG, VERTICES = (WIDE + 1) * (LONG + 1) };

typedef struct {
    float positions[VERTICES][3];
    uint16_t indices[TRIANGLES][3];
} scene;

static inline void make_scene(scene *s)
{
    for (unsigned y = 0; y <= LONG; y++)
        for (unsigned x = 0; x <= WIDE; x++) {
            const unsigned vertex = y * (WIDE + 1) + x;
            s->positions[vertex][0] = (float)x;
            s->positions[vertex][1] = (float)y;
            s->positions[vertex][2] = (float)((x * x * 7 + y * y * 5 + x * y * 3) % 61) / 32;
        }
    for (unsigned y = 0; y < LONG; y++)
        for (unsigned x = 0; x < WIDE; x++) {
            const unsigned a = y * (WIDE + 1) + x, d = a + WIDE + 1, at = 2 * (y * WIDE + x);
            const unsigned square[2][3] = {{a, a + 1, d + 1}, {a, d + 1, d}};
            for (int i = 0; i < 6; i++)
                s->indices[at + (unsigned)i / 3][i % 3] = (uint16_t)square[i / 3][i % 3];
        }
}

static inline hgrid_mesh mesh_of(const scene *s)
{
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.positions = s->positions, mesh.vertex_count = VERTICES;
    mesh.indices = s->indices, mesh.triangle_count = TRIANGLES, mesh.index_type = HGRID_INDEX_U16;
    return mesh;
}

/* The camera: 16 x 16 rays from above one end of the field. */
enum { RAYS = 256 };

static inline hgrid_ray camera_ray(int i)
{
    const hgrid_ray ray = {{12.5f, -2, 12},
                           0,
                           {((float)(i % 16) - 7.5f) / 16, 1, ((float)(i / 16) - 15) / 16},
                           1000};
    return ray;
}

#endif
