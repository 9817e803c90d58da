/* isatty, fileno and clock_gettime are POSIX, not C. */
#define _POSIX_C_SOURCE 200809L

#include "progress.h"

#include <stdio.h>
#include <time.h>
#include <unistd.h>

progress start_progress(const char *what, bool is_shown_anyway)
{
    const bool is_terminal = isatty(fileno(stderr));
    const progress p = {what, is_shown_anyway || is_terminal, is_terminal, -1};
    return p;
}

void show_progress(progress *p, double done)
{
    const int step = p->is_terminal ? 1 : 10;
    const int percent = (int)(100 * done) / step * step;
    if (!p->is_shown || percent <= p->percent)
        return;
    p->percent = percent;
    if (p->is_terminal)
        fprintf(stderr, "\r%s %3d %%%s", p->what, percent, percent < 100 ? "" : "\n");
    else
        fprintf(stderr, "%s %d %%\n", p->what, percent);
    fflush(stderr);
}

double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
