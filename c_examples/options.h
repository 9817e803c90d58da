/* What the command line says. */
#ifndef OPTIONS_H
#define OPTIONS_H

#include <stdbool.h>

typedef enum { NO_HEAT, HEAT_TESTS, HEAT_STEPS } heat_kind;

typedef struct {
    /* NULL: the built-in scene. */
    const char *input;
    const char *output;
    int size, threads;
    bool has_shadows, has_progress;
    /* Ambient occlusion: rays at each hit. */
    int sky_rays;
    heat_kind heat;
    /* An index of METHODS, and the density if it is not the usual one. */
    int method;
    float density;
} options;

/* Reads the ray tracer's words; answers --help itself. */
options parse_options(int count, char **words);

/* Pieces for other programs. `*i` is the place of an option; steps on to its value. */
const char *value_of(int count, char **words, int *i);

/* The value of an option as a whole number from `least` to `most`, or the end of the program. */
int parse_count(const char *option, const char *value, int least, int most);

#endif
