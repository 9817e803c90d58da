/* Writes the arrays of the built-in scene, for the test to compare bit by bit. */

#include "memory.h"
#include "scene.h"

#include <stdio.h>
#include <stdlib.h>

const char *const program_name = "knot_bits";

int main(void)
{
    scene s = make_knot();
    fwrite(s.positions, sizeof *s.positions, s.vertex_count, stdout);
    fwrite(s.indices, sizeof *s.indices, s.triangle_count, stdout);
    free(s.positions);
    free(s.indices);
    return 0;
}
