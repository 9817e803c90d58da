/*
 * PLY files: ascii and binary little endian, any number types, any other properties. Polygons are cut into
 * fans. Elements and properties may come in any order.
 *
 * Every number is read as a double, which holds all of PLY's types exactly: one code path for all.
 */

#include "memory.h"
#include "scene.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef enum { NO_TYPE, INT8, UINT8, INT16, UINT16, INT32, UINT32, FLOAT32, FLOAT64 } type;

enum { WORD = 32, LINE = 1024, MAX_PROPERTIES = 64, MAX_ELEMENTS = 16 };

typedef struct {
    type count; /* NO_TYPE if it is not a list */
    type item;
    char name[WORD];
} property;

typedef struct {
    char name[WORD];
    size_t count;
    property properties[MAX_PROPERTIES];
    int property_count;
} element;

typedef struct {
    FILE *file;
    const char *path;
    bool is_ascii;
    element elements[MAX_ELEMENTS];
    int element_count;
} ply;

static type type_of(const char *name)
{
    static const struct {
        const char *names[2];
        type type;
    } types[] = {
        {{"char", "int8"}, INT8},       {{"uchar", "uint8"}, UINT8},
        {{"short", "int16"}, INT16},    {{"ushort", "uint16"}, UINT16},
        {{"int", "int32"}, INT32},      {{"uint", "uint32"}, UINT32},
        {{"float", "float32"}, FLOAT32}, {{"double", "float64"}, FLOAT64},
    };
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if (strcmp(name, types[i].names[0]) == 0 || strcmp(name, types[i].names[1]) == 0)
            return types[i].type;
    return NO_TYPE;
}

static void read_property(const ply *p, element *e, const char *line)
{
    char count[WORD], item[WORD];
    property *to = &e->properties[e->property_count];
    if (e->property_count == MAX_PROPERTIES)
        fail("%s: more than %d properties", p->path, MAX_PROPERTIES);
    to->count = NO_TYPE;
    if (sscanf(line, "property list %31s %31s %31s", count, item, to->name) == 3) {
        to->count = type_of(count);
        to->item = type_of(item);
        if (to->count == NO_TYPE)
            fail("%s: unknown type in `%s`", p->path, line);
    } else if (sscanf(line, "property %31s %31s", item, to->name) == 2) {
        to->item = type_of(item);
    } else {
        fail("%s: cannot read `%s`", p->path, line);
    }
    if (to->item == NO_TYPE)
        fail("%s: unknown type in `%s`", p->path, line);
    e->property_count++;
}

static void read_element(ply *p, const char *line)
{
    unsigned long long count;
    element *e = &p->elements[p->element_count];
    if (p->element_count == MAX_ELEMENTS)
        fail("%s: more than %d elements", p->path, MAX_ELEMENTS);
    if (sscanf(line, "element %31s %llu", e->name, &count) != 2 || count > UINT32_MAX)
        fail("%s: cannot read `%s`", p->path, line);
    e->count = (size_t)count;
    e->property_count = 0;
    p->element_count++;
}

/* Reads a line, or the start of a longer one, without its end. Returns false at the end of the file. */
static bool read_line(FILE *file, char line[LINE])
{
    if (fgets(line, LINE, file) == NULL)
        return false;
    if (strchr(line, '\n') == NULL)
        for (int letter = 0; letter != '\n' && letter != EOF;)
            letter = getc(file);
    line[strcspn(line, "\r\n")] = '\0';
    return true;
}

static void read_header(ply *p)
{
    char line[LINE], format[WORD] = "";
    bool is_first = true;
    while (read_line(p->file, line)) {
        char word[WORD] = "";
        sscanf(line, "%31s", word);
        if (is_first && strcmp(word, "ply") != 0)
            fail("%s: not a PLY file", p->path);
        is_first = false;
        if (strcmp(word, "format") == 0)
            sscanf(line, "format %31s", format);
        else if (strcmp(word, "element") == 0)
            read_element(p, line);
        else if (strcmp(word, "property") == 0 && p->element_count > 0)
            read_property(p, &p->elements[p->element_count - 1], line);
        else if (strcmp(word, "end_header") == 0) {
            p->is_ascii = strcmp(format, "ascii") == 0;
            if (!p->is_ascii && strcmp(format, "binary_little_endian") != 0)
                fail("%s: the format is `%s`: convert it to binary_little_endian or ascii", p->path,
                     format);
            return;
        }
    }
    if (ferror(p->file))
        fail("%s: cannot be read: %s", p->path, strerror(errno));
    fail("%s: %s", p->path, is_first ? "not a PLY file: it is empty" : "no end_header line");
}

/* Reads the next number of the file; returns false at the end of the file or if what follows is no number. */
static bool next_number(const ply *p, type t, double *number)
{
    static const unsigned char sizes[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
    unsigned char bytes[8];
    uint64_t word = 0;
    if (p->is_ascii)
        return fscanf(p->file, "%lf", number) == 1;
    if (fread(bytes, 1, sizes[t], p->file) != sizes[t])
        return false;
    for (int i = 0; i < sizes[t]; i++)
        word |= (uint64_t)bytes[i] << (8 * i);

    const uint32_t word32 = (uint32_t)word;
    float single;
    switch (t) {
    case INT8: *number = (int8_t)word; break;
    case INT16: *number = (int16_t)word; break;
    case INT32: *number = (int32_t)word; break;
    case FLOAT32: memcpy(&single, &word32, sizeof single), *number = single; break;
    case FLOAT64: memcpy(number, &word, sizeof word); break;
    default: *number = (double)word; break;
    }
    return true;
}

static double read_number(const ply *p, type t, const element *e, size_t index)
{
    double number;
    if (!next_number(p, t, &number))
        fail("%s: the file ends, or has no number, in %s %lu of %lu", p->path, e->name,
             (unsigned long)index, (unsigned long)e->count);
    return number;
}

/* Returns the count of numbers that a property has here. */
static size_t read_count(const ply *p, const property *from, const element *e, size_t index)
{
    if (from->count == NO_TYPE)
        return 1;
    const double count = read_number(p, from->count, e, index);
    if (!(count >= 0 && count <= UINT32_MAX))
        fail("%s: a list of length %g in %s %lu", p->path, count, e->name, (unsigned long)index);
    return (size_t)count;
}

static void skip(const ply *p, const property *from, const element *e, size_t index)
{
    for (size_t left = read_count(p, from, e, index); left > 0; left--)
        read_number(p, from->item, e, index);
}

static void skip_element(const ply *p, const element *e)
{
    for (size_t index = 0; index < e->count; index++)
        for (int i = 0; i < e->property_count; i++)
            skip(p, &e->properties[i], e, index);
}

/* Returns 0, 1, 2 for a coordinate, -1 for anything else. */
static int axis_of(const property *from)
{
    static const char *const names[] = {"x", "y", "z"};
    for (int axis = 0; axis < 3; axis++)
        if (from->count == NO_TYPE && strcmp(from->name, names[axis]) == 0)
            return axis;
    return -1;
}

static void read_vertices(const ply *p, const element *e, scene *s)
{
    int axes = 0;
    for (int i = 0; i < e->property_count; i++)
        if (axis_of(&e->properties[i]) >= 0)
            axes |= 1 << axis_of(&e->properties[i]);
    if (axes != 7)
        fail("%s: the vertices have no x, y, z", p->path);

    free(s->positions);
    s->positions = (float(*)[3])allocate(e->count, sizeof *s->positions);
    s->vertex_count = e->count;
    for (size_t index = 0; index < e->count; index++)
        for (int i = 0; i < e->property_count; i++) {
            const property *from = &e->properties[i];
            const int axis = axis_of(from);
            if (axis < 0)
                skip(p, from, e, index);
            else
                s->positions[index][axis] = (float)read_number(p, from->item, e, index);
        }
}

static void add_triangle(scene *s, size_t *room, uint32_t a, uint32_t b, uint32_t c)
{
    if (s->triangle_count == *room) {
        *room = *room + *room / 2 + 1024;
        uint32_t(*more)[3] = (uint32_t(*)[3])allocate(*room, sizeof *more);
        if (s->triangle_count > 0)
            memcpy(more, s->indices, s->triangle_count * sizeof *more);
        free(s->indices);
        s->indices = more;
    }
    const uint32_t triangle[3] = {a, b, c};
    memcpy(s->indices[s->triangle_count++], triangle, sizeof triangle);
}

/* Reads a polygon and cuts it into a fan around its first corner. */
static void read_polygon(const ply *p, const property *from, const element *e, size_t index,
                         scene *s, size_t *room)
{
    const size_t corners = read_count(p, from, e, index);
    uint32_t first = 0, last = 0;
    for (size_t i = 0; i < corners; i++) {
        const double number = read_number(p, from->item, e, index);
        /* hgrid refuses a mesh with this index, and names the triangle. */
        const bool is_number = number >= 0 && number < UINT32_MAX;
        const uint32_t corner = is_number ? (uint32_t)number : UINT32_MAX;
        if (i == 0)
            first = corner;
        if (i >= 2)
            add_triangle(s, room, first, last, corner);
        last = corner;
    }
}

/* Returns true for the list of a polygon's corners. */
static bool has_corners(const property *from)
{
    return from->count != NO_TYPE && (strcmp(from->name, "vertex_indices") == 0 ||
                                      strcmp(from->name, "vertex_index") == 0);
}

/* Returns true if faces have lists of corners, even if there is no face. */
static bool has_triangles(const ply *p)
{
    for (int i = 0; i < p->element_count; i++)
        for (int j = 0; j < p->elements[i].property_count; j++)
            if (strcmp(p->elements[i].name, "face") == 0 && has_corners(&p->elements[i].properties[j]))
                return true;
    return false;
}

static void read_faces(const ply *p, const element *e, scene *s)
{
    size_t room = s->triangle_count;
    for (size_t index = 0; index < e->count; index++)
        for (int i = 0; i < e->property_count; i++) {
            const property *from = &e->properties[i];
            if (has_corners(from))
                read_polygon(p, from, e, index, s, &room);
            else
                skip(p, from, e, index);
        }
}

scene load_ply(const char *path)
{
    scene s = {NULL, 0, NULL, 0};
    ply p = {NULL, NULL, false, {{"", 0, {{NO_TYPE, NO_TYPE, ""}}, 0}}, 0};
    p.path = path;
    p.file = fopen(path, "rb");
    if (p.file == NULL)
        fail("%s: cannot be opened: %s", path, strerror(errno));
    read_header(&p);
    if (!has_triangles(&p))
        fail("%s: no triangles: it needs an element `face` with a list `vertex_indices`", path);
    for (int i = 0; i < p.element_count; i++) {
        const element *e = &p.elements[i];
        if (strcmp(e->name, "vertex") == 0)
            read_vertices(&p, e, &s);
        else if (strcmp(e->name, "face") == 0)
            read_faces(&p, e, &s);
        else
            skip_element(&p, e);
    }
    fclose(p.file);
    return s;
}
