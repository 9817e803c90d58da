/* Builds a tree over 2000 triangles in static RAM, and traces rays in it: all within 128 KB. */

#include "measure.h"
#include "scene.h"
#include "start.h"

static scene field;
HGRID_ALIGNED static unsigned char grid_memory[HGRID_INDEX_BOUND(TRIANGLES)];
HGRID_ALIGNED static unsigned char scratch[HGRID_SCRATCH_BOUND(TRIANGLES)];

int run(void)
{
    make_scene(&field);
    const hgrid_mesh mesh = mesh_of(&field);
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid grid;
    print_number(TRIANGLES), print(" triangles: mesh "), print_number(sizeof field);
    print(" bytes, grid "), print_number(sizeof grid_memory);
    print(", scratch "), print_number(sizeof scratch), print(" (free after the build)\n");

    paint_stack();
    const uint32_t before = ticks();
    const hgrid_status status = hgrid_build(&mesh, NULL, grid_memory, sizeof grid_memory, scratch,
                                            sizeof scratch, &grid, &report);
    tell("build", "triangle", before, TRIANGLES);
    if (status != HGRID_OK) {
        print(hgrid_status_string(status)), print("\n");
        return 1;
    }
    print("of the grid's memory used: "), print_number((uint32_t)report.index_bytes), print("\n");
    trace(&grid);
    return 0;
}
