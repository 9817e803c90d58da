/* Progress and time, for people who wait. */
#ifndef PROGRESS_H
#define PROGRESS_H

#include <stdbool.h>

typedef struct {
    const char *what;
    bool is_shown, is_terminal;
    /* The last shown value, in per cent. */
    int percent;
} progress;

/* Starts a line on stderr that changes in place, if stderr is a terminal. Otherwise it writes a line for each
 * tenth, if `is_shown_anyway`. */
progress start_progress(const char *what, bool is_shown_anyway);

/* Shows that a part `done`, from 0 to 1, is complete. One thread at a time may call it. */
void show_progress(progress *p, double done);

/* Returns the seconds since some fixed moment. */
double now(void);

#endif
