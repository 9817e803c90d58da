/* Runs the sums where there is an operating system. */

#include "sums.h"

#include <stdio.h>

void say(const char *mesh, const char *method, const char *what, uint64_t sum)
{
    printf("%s %s %s %08lx%08lx\n", mesh, method, what, (unsigned long)(sum >> 32),
           (unsigned long)(sum & 0xffffffffu));
}

int main(void)
{
    const int failure = sums();
    if (failure)
        fprintf(stderr, "step %d failed\n", failure);
    return failure != 0;
}
