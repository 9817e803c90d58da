/* The command line. */
#ifndef OPTIONS_H
#define OPTIONS_H

#include <stdbool.h>

typedef enum { NO_HEAT, HEAT_TESTS, HEAT_STEPS } heat_kind;

typedef struct {
    /* The mesh file, or NULL for the built-in scene. */
    const char *input;
    const char *output;
    int size, threads;
    bool has_shadows, has_progress;
    /* Ambient occlusion: rays at each hit. */
    int sky_rays;
    heat_kind heat;
    /* An index into METHODS, and the density if it is not the default. */
    int method;
    float density;
} options;

/* Parses the ray tracer's arguments; prints the help for --help. */
options parse_options(int count, char **words);

/* Parts for other programs: returns the value of the option at `*i`, and advances `*i` to it. */
const char *value_of(int count, char **words, int *i);

/* Returns the value of an option as a whole number from `least` to `most`; ends the program if it is none. */
int parse_count(const char *option, const char *value, int least, int most);

/* Ends the program if a file that is read, or NULL, has the name of one that is written. */
void refuse_same(const char *read, const char *written);

#endif
