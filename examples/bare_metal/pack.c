/* Packs grid and mesh of the scene into a file, on the PC. */

#include "scene.h"

#include <stdio.h>

static scene field;
HGRID_ALIGNED static unsigned char grid_memory[HGRID_INDEX_BOUND(TRIANGLES)];
HGRID_ALIGNED static unsigned char scratch[HGRID_SCRATCH_BOUND(TRIANGLES)];
HGRID_ALIGNED static unsigned char packed[sizeof grid_memory + 2 * sizeof field];

int main(int argc, char **argv)
{
    hgrid_grid grid;
    uint64_t bytes;
    make_scene(&field);
    const hgrid_mesh mesh = mesh_of(&field);
    hgrid_status status = hgrid_build(&mesh, NULL, grid_memory, sizeof grid_memory, scratch,
                                      sizeof scratch, &grid, NULL);
    if (status == HGRID_OK)
        status = hgrid_pack(&grid, packed, sizeof packed, &bytes);
    if (status != HGRID_OK)
        return fprintf(stderr, "%s\n", hgrid_status_string(status)), 1;
    FILE *file = argc > 1 ? fopen(argv[1], "wb") : NULL;
    const int is_written = file != NULL && fwrite(packed, 1, (size_t)bytes, file) == bytes;
    return file == NULL || fclose(file) != 0 || !is_written;
}
