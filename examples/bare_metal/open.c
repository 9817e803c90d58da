/* Opens a blob in flash, which pack.c made on the PC, and traces rays in it: no RAM but the stack. */

#include "measure.h"
#include "scene.h"
#include "start.h"

/* The blob, which blob.S places at a multiple of HGRID_ALIGNMENT. */
extern const unsigned char blob[], blob_end[];

int run(void)
{
    hgrid_grid grid;
    paint_stack();
    const uint32_t before = ticks();
    const hgrid_status status = hgrid_open(blob, (size_t)(blob_end - blob), NULL, &grid);
    tell("open", "blob", before, 1);
    if (status != HGRID_OK) {
        print(hgrid_status_string(status)), print("\n");
        return 1;
    }
    print("grid and mesh in flash: "), print_number((uint32_t)(blob_end - blob)), print(" bytes\n");
    trace(&grid);
    return 0;
}
