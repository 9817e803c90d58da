#include "heat.h"

#include "memory.h"
#include "picture.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* --- colours --------------------------------------------------------------------------------- */

/* Colours from no work to much; those between are mixed. Their brightness rises with the work, so that the
 * order shows on paper, too. */
static const unsigned char RAMP[][3] = {
    {8, 8, 24}, {52, 16, 110}, {140, 34, 122}, {214, 70, 76}, {250, 150, 40}, {252, 252, 170},
};
enum { RAMP_PARTS = sizeof RAMP / sizeof *RAMP - 1 };

static const unsigned char PAPER[3] = {255, 255, 255}, INK[3] = {0, 0, 0};

static void colour_of(uint32_t work, uint32_t top, unsigned char pixel[3])
{
    const double at = (work < top ? (double)work / top : 1) * RAMP_PARTS;
    const int part = at < RAMP_PARTS ? (int)at : RAMP_PARTS - 1;
    for (int i = 0; i < 3; i++) {
        const double from = RAMP[part][i], to = RAMP[part + 1][i];
        pixel[i] = (unsigned char)(from + (to - from) * (at - part) + 0.5);
    }
}

static int by_size(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Returns the end of the scale: 2, 4, 6, 8, 10, 20, 40, ... Its half is the middle label. */
static uint32_t top_of(const uint32_t *work, size_t count)
{
    uint32_t *sorted = (uint32_t *)allocate(count, sizeof *sorted);
    memcpy(sorted, work, count * sizeof *sorted);
    qsort(sorted, count, sizeof *sorted, by_size);
    const uint32_t most = sorted[(count - 1) * 99 / 100];
    free(sorted);
    uint64_t unit = 1;
    while (unit * 10 < most)
        unit *= 10;
    uint64_t top = 2 * unit;
    while (top < most)
        top += 2 * unit;
    return top < UINT32_MAX ? (uint32_t)top : UINT32_MAX;
}

/* --- letters --------------------------------------------------------------------------------- */

/* 3 x 5 dots: an octal digit for each row, from the top. */
static const struct {
    char letter;
    unsigned rows;
} LETTERS[] = {
    {'0', 075557}, {'1', 026227}, {'2', 071747}, {'3', 071717}, {'4', 055711}, {'5', 074717},
    {'6', 074757}, {'7', 071111}, {'8', 075757}, {'9', 075717}, {'+', 002720}, {'E', 074747},
    {'P', 075744}, {'S', 074717}, {'T', 072222},
};
enum { LETTER_WIDTH = 4, LETTER_HEIGHT = 5 };

static unsigned rows_of(char letter)
{
    for (size_t i = 0; i < sizeof LETTERS / sizeof *LETTERS; i++)
        if (LETTERS[i].letter == letter)
            return LETTERS[i].rows;
    return 0;
}

/* A picture with room for a bar. A dot of its letters is `dot` pixels wide. */
typedef struct {
    unsigned char *pixels;
    int width, dot;
} sheet;

static void put(const sheet *s, int x, int y, const unsigned char colour[3])
{
    memcpy(s->pixels + 3 * ((size_t)y * (size_t)s->width + (size_t)x), colour, 3);
}

static int width_of(const sheet *s, const char *text)
{
    return (LETTER_WIDTH * (int)strlen(text) - 1) * s->dot;
}

static void write_text(const sheet *s, const char *text, int left, int top)
{
    for (; *text != '\0'; text++, left += LETTER_WIDTH * s->dot)
        for (int y = 0; y < LETTER_HEIGHT * s->dot; y++)
            for (int x = 0; x < (LETTER_WIDTH - 1) * s->dot; x++) {
                const int bit = 3 * (LETTER_HEIGHT - 1 - y / s->dot) + 2 - x / s->dot;
                if (rows_of(*text) >> bit & 1)
                    put(s, left + x, top + y, INK);
            }
}

/* --- the bar --------------------------------------------------------------------------------- */

enum {
    LEGIBLE = 96,
    /* In dots. */
    GAP = 2,
    BAR_HEIGHT = 6,
    LEGEND_HEIGHT = 5 * GAP + 2 * LETTER_HEIGHT + BAR_HEIGHT
};

static void draw_legend(const sheet *s, int top, uint32_t most, const char *name)
{
    const int gap = GAP * s->dot, line = LETTER_HEIGHT * s->dot, left = gap;
    const int right = s->width - gap, bar = top + 2 * gap + line, bar_end = bar + BAR_HEIGHT * s->dot;
    for (int y = top; y < top + LEGEND_HEIGHT * s->dot; y++)
        for (int x = 0; x < s->width; x++)
            put(s, x, y, PAPER);
    write_text(s, name, left, top + gap);
    for (int y = bar; y < bar_end; y++)
        for (int x = left; x < right; x++) {
            unsigned char colour[3];
            colour_of((uint32_t)(x - left), (uint32_t)(right - left - 1), colour);
            put(s, x, y, colour);
        }
    char half[16], end[16];
    snprintf(half, sizeof half, "%lu", (unsigned long)(most / 2));
    snprintf(end, sizeof end, "%lu+", (unsigned long)most);
    write_text(s, "0", left, bar_end + gap);
    write_text(s, half, (left + right - width_of(s, half)) / 2, bar_end + gap);
    write_text(s, end, right - width_of(s, end), bar_end + gap);
}

void write_heat(FILE *file, const char *path, int size, const uint32_t *work, const char *name)
{
    const size_t count = (size_t)size * (size_t)size;
    const uint32_t top = top_of(work, count);
    const bool has_legend = size >= LEGIBLE;
    sheet s = {NULL, size, 1 + size / 320};
    const int height = size + (has_legend ? LEGEND_HEIGHT * s.dot : 0);
    s.pixels = (unsigned char *)allocate((size_t)size * (size_t)height, 3);
    for (size_t i = 0; i < count; i++)
        colour_of(work[i], top, s.pixels + 3 * i);
    if (has_legend)
        draw_legend(&s, size, top, name);
    write_picture(file, path, size, height, s.pixels);
    free(s.pixels);
}
