/* Runs the sums without an operating system, with the start-up code of examples/bare_metal. */

#include "sums.h"

#include "start.h"

void say(const char *mesh, const char *method, const char *what, uint64_t sum)
{
    print(mesh), print(" "), print(method), print(" "), print(what), print(" ");
    print_sum(sum), print("\n");
}

int run(void)
{
    return sums();
}
