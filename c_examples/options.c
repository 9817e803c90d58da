#include "options.h"

#include "grid.h"
#include "render.h"
#include "threads.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { DEFAULT_SIZE = 1024, MAX_SKY_RAYS = 4096 };

static const char HELP[] =
    "raytracer [OPTIONS] [FILE.ply]   draws a triangle mesh; without a file, the built-in one\n"
    "\n"
    "the picture\n"
    "  -o FILE.ppm        where it goes; raytracer.ppm\n"
    "  --size PIXELS      on each side, 1 to 16384; 1024\n"
    "  --shadows          one more ray for each hit, towards the lamp\n"
    "  --ao RAYS          ambient occlusion: rays for each hit that look for the sky,\n"
    "                     1 to 4096; 16 give an idea, 256 a smooth picture\n"
    "  --heat WHAT        instead of the picture what each pixel cost, with all its rays:\n"
    "                     tests (of triangles) or steps (from cell to cell)\n"
    "\n"
    "the grid\n"
    "  --method NAME      bvh, one-level, fixed, variable or recursive; bvh\n"
    "  --density CELLS    for each triangle; not for bvh\n"
    "\n"
    "the work\n"
    "  --threads COUNT    that draw and, with bvh, build, 1 to 256; 1. The picture\n"
    "                     is the same with any number\n"
    "  --progress         report progress even if standard error is no terminal\n"
    "  --help             this text\n"
    "\n"
    "Try: raytracer --shadows --ao 64 --threads 4\n"
    "     raytracer --method fixed --heat steps -o steps.ppm\n";

const char *value_of(int count, char **words, int *i)
{
    const char *option = words[*i];
    if (++*i >= count)
        fail("%s needs a value", option);
    return words[*i];
}

int parse_count(const char *option, const char *value, int least, int most)
{
    char *end;
    const long number = strtol(value, &end, 10);
    if (number < least || number > most || end == value || *end != '\0')
        fail("%s is a number from %d to %d, not `%s`", option, least, most, value);
    return (int)number;
}

void refuse_same(const char *read, const char *written)
{
    if (read != NULL && strcmp(read, written) == 0)
        fail("%s is read and would be overwritten: name another file", read);
}

static float parse_number(const char *option, const char *value)
{
    char *end;
    const float number = strtof(value, &end);
    if (!(number > 0) || *end != '\0')
        fail("%s is a number above 0, not `%s`", option, value);
    return number;
}

static int parse_method(const char *value)
{
    for (int i = 0; i < METHOD_COUNT; i++)
        if (strcmp(value, METHODS[i].name) == 0)
            return i;
    fail("--method is bvh, one-level, fixed, variable or recursive, not `%s`", value);
    return 0;
}

static heat_kind parse_heat(const char *value)
{
    if (strcmp(value, "tests") != 0 && strcmp(value, "steps") != 0)
        fail("--heat is tests or steps, not `%s`", value);
    return value[0] == 't' ? HEAT_TESTS : HEAT_STEPS;
}

static bool is(const char *word, const char *option)
{
    return strcmp(word, option) == 0;
}

options parse_options(int count, char **words)
{
    options o = {NULL, "raytracer.ppm", DEFAULT_SIZE, 1, false, false, 0, NO_HEAT, 0, 0};
    for (int i = 1; i < count; i++) {
        const char *word = words[i];
        if (is(word, "--help")) {
            fputs(HELP, stdout);
            exit(0);
        } else if (is(word, "--shadows")) {
            o.has_shadows = true;
        } else if (is(word, "--progress")) {
            o.has_progress = true;
        } else if (is(word, "-o")) {
            o.output = value_of(count, words, &i);
        } else if (is(word, "--size")) {
            o.size = parse_count(word, value_of(count, words, &i), 1, MAX_SIZE);
        } else if (is(word, "--threads")) {
            o.threads = parse_count(word, value_of(count, words, &i), 1, MAX_THREADS);
        } else if (is(word, "--ao")) {
            o.sky_rays = parse_count(word, value_of(count, words, &i), 1, MAX_SKY_RAYS);
        } else if (is(word, "--heat")) {
            o.heat = parse_heat(value_of(count, words, &i));
        } else if (is(word, "--method")) {
            o.method = parse_method(value_of(count, words, &i));
        } else if (is(word, "--density")) {
            o.density = parse_number(word, value_of(count, words, &i));
        } else if (word[0] == '-') {
            fail("unknown option %s: raytracer --help names all of them", word);
        } else if (o.input != NULL) {
            fail("one scene at a time: %s or %s?", o.input, word);
        } else {
            o.input = word;
        }
    }
    refuse_same(o.input, o.output);
    if (o.density > 0 && METHODS[o.method].config.method == HGRID_METHOD_BVH)
        fail("--method %s has no density: leave out --density", METHODS[o.method].name);
    return o;
}
