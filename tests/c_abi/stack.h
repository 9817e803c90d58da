/* The meshes of stack.c: a sheet, and triangles on it for which builds or rays take more stack. */

enum { CROWDS = 2, CROWD = 17000 };
/* The triangles of a tangle, and those of them in the chain; those of a chain alone. */
enum { TANGLE = 1480, CHAIN = 480, LINKED_CHAIN = 400 };
/* The layers of outer triangles in a nested mesh, and the triangles of its crowd. The bins of the mesh tell one layer
 * from the crowd, and so does each division of the crowd's bin. There are five divisions, as many as a build makes at
 * most. A layer is large enough to be in the sample that a division takes: it would pass over a few triangles. */
enum { LAYERS = 6, LAYER = 200, OUTER = LAYERS * LAYER, CORE = 4500 };
/* Meshes have the number of their crowds; behind them come a tangle, a chain that makes a tree of few levels, and a
 * nested mesh. */
enum { TANGLED = CROWDS + 1, LINKED, NESTED, MESHES };

/* The centre of the crowds, and half the width of each. */
static const float CENTER[3] = {0.3f, 0.3f, 0.05f}, WIDTH[CROWDS] = {0.01f, 0.0005f};

static float positions[VERTICES + CROWDS * CROWD * 3][3];
static uint32_t indices[TRIANGLES + CROWDS * CROWD][3];

/* Returns a random number from -1 to 1. */
static float random_number(void)
{
    static uint32_t state = 1;
    state = state * 1664525u + 1013904223u;
    return (float)(state >> 8) / 8388608.0f - 1;
}

/* Returns the sheet with the first crowds. */
static hgrid_mesh crowded(uint32_t crowds)
{
    static sheet data;
    make_sheet(&data);
    memcpy(positions, data.positions, sizeof data.positions);
    memcpy(indices, data.indices, sizeof data.indices);
    for (uint32_t i = 0; i < CROWDS * CROWD; i++) {
        float center[3];
        for (int axis = 0; axis < 3; axis++)
            center[axis] = CENTER[axis] + WIDTH[i / CROWD] * random_number();
        for (uint32_t corner = 0; corner < 3; corner++) {
            const uint32_t vertex = VERTICES + 3 * i + corner;
            indices[TRIANGLES + i][corner] = vertex;
            for (int axis = 0; axis < 3; axis++)
                positions[vertex][axis] = center[axis] + 0.03f * WIDTH[i / CROWD] * random_number();
        }
    }
    hgrid_mesh all = mesh_of(&data);
    all.positions = positions;
    all.vertex_count = VERTICES + crowds * CROWD * 3;
    all.indices = indices;
    all.triangle_count = TRIANGLES + crowds * CROWD;
    return all;
}

/* Returns the sheet in a tangle: long triangles, and a chain of triangles around the origin. */
static hgrid_mesh tangled(void)
{
    hgrid_mesh all = crowded(0);
    for (uint32_t i = 0; i < TANGLE; i++) {
        /* Four triangles of each size. */
        const float size = i < CHAIN ? ldexpf(1, -(int)(i / 4)) : 1;
        for (uint32_t corner = 0; corner < 3; corner++) {
            const uint32_t vertex = VERTICES + 3 * i + corner;
            indices[TRIANGLES + i][corner] = vertex;
            for (int axis = 0; axis < 3; axis++)
                positions[vertex][axis] = size * random_number();
        }
    }
    all.vertex_count += TANGLE * 3, all.triangle_count += TANGLE;
    return all;
}

/* Returns the sheet with a chain of triangles whose boxes share a corner: a ray along the diagonal enters all boxes at
 * once, and misses the triangles. */
static hgrid_mesh linked(void)
{
    hgrid_mesh all = crowded(0);
    for (uint32_t i = 0; i < LINKED_CHAIN; i++) {
        const float size = ldexpf(1, -(int)(i / 4));
        const float corners[3][3] = {{0, 0, size}, {size, 0, 0}, {size, 0.9f * size, 0}};
        for (uint32_t corner = 0; corner < 3; corner++) {
            const uint32_t vertex = VERTICES + 3 * i + corner;
            indices[TRIANGLES + i][corner] = vertex;
            memcpy(positions[vertex], corners[corner], sizeof corners[corner]);
        }
    }
    all.vertex_count += LINKED_CHAIN * 3, all.triangle_count += LINKED_CHAIN;
    return all;
}

/* Returns the sheet with a crowd near the origin and triangles far from it; all of that far from other, larger
 * triangles; and so on. */
static hgrid_mesh nested(void)
{
    hgrid_mesh all = crowded(0);
    for (uint32_t i = 0; i < OUTER + CORE; i++) {
        const bool is_core = i >= OUTER;
        const float scale = ldexpf(1, -6 * (is_core ? LAYERS : (int)(i / LAYER)));
        float center[3];
        for (int axis = 0; axis < 3; axis++)
            center[axis] = is_core ? scale * (0.5f + 0.5f * random_number()) : scale;
        for (uint32_t corner = 0; corner < 3; corner++) {
            const uint32_t vertex = VERTICES + 3 * i + corner;
            indices[TRIANGLES + i][corner] = vertex;
            for (int axis = 0; axis < 3; axis++)
                positions[vertex][axis] = center[axis] + 0.001f * scale * random_number();
        }
    }
    all.vertex_count += (OUTER + CORE) * 3, all.triangle_count += OUTER + CORE;
    return all;
}

static hgrid_mesh mesh_number(uint32_t number)
{
    switch (number) {
    case TANGLED: return tangled();
    case LINKED: return linked();
    case NESTED: return nested();
    default: return crowded(number);
    }
}
