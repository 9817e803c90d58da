/* A part of sums.c: a small object in a large scene. Nearly all of its triangles share a bin, which a build divides. */

enum {
    CROWD_SIDE = 52,
    OTHERS = 40,
    CROWD_VERTICES = (CROWD_SIDE + 1) * (CROWD_SIDE + 1) + 3 * OTHERS,
    CROWD_TRIANGLES = 2 * CROWD_SIDE * CROWD_SIDE + OTHERS
};

static float crowd_positions[CROWD_VERTICES][3];
static uint16_t crowd_indices[CROWD_TRIANGLES][3];

static void set_crowd_triangle(uint32_t triangle, uint32_t a, uint32_t b, uint32_t c)
{
    crowd_indices[triangle][0] = (uint16_t)a;
    crowd_indices[triangle][1] = (uint16_t)b;
    crowd_indices[triangle][2] = (uint16_t)c;
}

/* Makes a wavy sheet, one unit on a side, and triangles all around it. */
static void make_crowd(void)
{
    uint32_t vertex = 0, triangle = 0;
    state = 9;
    for (uint32_t y = 0; y <= CROWD_SIDE; y++)
        for (uint32_t x = 0; x <= CROWD_SIDE; x++, vertex++) {
            crowd_positions[vertex][0] = (float)(x * 19) / 1024;
            crowd_positions[vertex][1] = (float)(y * 19) / 1024;
            crowd_positions[vertex][2] = (float)random_below(300) / 1024;
        }
    for (uint32_t y = 0; y < CROWD_SIDE; y++)
        for (uint32_t x = 0; x < CROWD_SIDE; x++) {
            const uint32_t a = y * (CROWD_SIDE + 1) + x, d = a + CROWD_SIDE + 1;
            set_crowd_triangle(triangle++, a, a + 1, d + 1);
            set_crowd_triangle(triangle++, a, d + 1, d);
        }
    for (; triangle < CROWD_TRIANGLES; triangle++, vertex += 3) {
        /* Every other one in the eight units around the sheet, which are its bin. */
        const uint32_t width = triangle % 2 ? 8 : 32;
        set_crowd_triangle(triangle, vertex, vertex + 1, vertex + 2);
        for (int axis = 0; axis < 3; axis++) {
            const uint32_t at = random_below(width * 64);
            for (uint32_t corner = 0; corner < 3; corner++)
                crowd_positions[vertex + corner][axis] = (float)(at + random_below(64)) / 64 - 4;
        }
    }
}

static int ask_crowd(void)
{
    hgrid_mesh mesh = HGRID_MESH_INIT;
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid grid;
    make_crowd();
    mesh.positions = crowd_positions, mesh.vertex_count = CROWD_VERTICES;
    mesh.indices = crowd_indices, mesh.triangle_count = CROWD_TRIANGLES;
    mesh.index_type = HGRID_INDEX_U16;
    if (hgrid_build(&mesh, NULL, index_region, sizeof index_region, scratch, sizeof scratch, &grid,
                    &report) != HGRID_OK)
        return 1;
    start();
    add(report.index_bytes);
    if (add_content(&grid))
        return 2;
    say("large", "bvh-crowd", "build", sum);
    start();
    for (int i = 0; i < RAYS; i++) {
        hgrid_hit hit;
        if (hgrid_intersect(&grid, &rays[i], NULL, &hit))
            add_hit(&hit);
        add(hgrid_occluded(&grid, &rays[i], NULL));
    }
    say("large", "bvh-crowd", "hits", sum);
    return 0;
}
