/* How far something is, and what time it is, for people who wait. */
#ifndef PROGRESS_H
#define PROGRESS_H

#include <stdbool.h>

typedef struct {
    const char *what;
    bool is_shown, is_terminal;
    /* What was shown last, in per cent. */
    int percent;
} progress;

/* A line on stderr that changes in place, if that is a terminal. Elsewhere, if it is to be shown
 * anyway, a line for each tenth. */
progress start_progress(const char *what, bool is_shown_anyway);

/* `done` is from 0 to 1. One thread at a time. */
void show_progress(progress *p, double done);

/* Seconds since some moment. */
double now(void);

#endif
