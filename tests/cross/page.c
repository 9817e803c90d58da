/* Runs the sums in WebAssembly, where JavaScript prints the lines. */

#include "sums.h"

__attribute__((import_module("env"), import_name("line"))) void
line(const char *mesh, const char *method, const char *what, uint32_t high, uint32_t low);

void say(const char *mesh, const char *method, const char *what, uint64_t sum)
{
    line(mesh, method, what, (uint32_t)(sum >> 32), (uint32_t)sum);
}

__attribute__((export_name("run"))) int run(void)
{
    return sums();
}
