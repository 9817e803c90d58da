/*
 * A ray tracer of one file, but for the scene: one thread, one ray per pixel, diffuse light. Rays
 * are traced by tiles of 8 x 8 pixels, all rays of a tile in one call.
 *
 *     raytracer                          the built-in scene, to raytracer.ppm
 *     raytracer bunny.ply -o bunny.ppm   a mesh of yours
 *     raytracer --size 256               pixels on each side
 *     raytracer --method variable        one-level, fixed, variable, recursive or brick
 *     raytracer --density 8              cells for each triangle, not for brick
 *     raytracer --cell-size 2            cells twice as wide as usual, for brick
 *
 * What to look at: allocate_grid (sizes, memory), main (the build) and trace (the query). Camera
 * and light are those of the project's own renderer in lab/, so the two draw the same picture, byte
 * by byte.
 *
 * What it prints: `sizes` is the time of asking hgrid_sizes and of malloc, `build` is that of
 * hgrid_build alone, `time to image` is all from the mesh to the last pixel.
 */

#include "scene.h"

#include <hgrid.h>

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { DEFAULT_SIZE = 1024, MAX_SIZE = 16384, TILE = 8 };

typedef struct {
    double x, y, z;
} vector;

/* A memory region at a multiple of HGRID_ALIGNMENT, and what to free. */
typedef struct {
    void *start;
    size_t bytes;
    void *allocation;
} region;

typedef struct {
    float eye[3], right[3], up[3], forward[3];
} camera;

void fail(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fputs("raytracer: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    exit(1);
}

void *allocate(size_t count, size_t size)
{
    void *memory = count <= SIZE_MAX / size ? malloc(count > 0 ? count * size : 1) : NULL;
    if (memory == NULL)
        fail("not enough memory for %lu times %lu bytes", (unsigned long)count,
             (unsigned long)size);
    return memory;
}

/* C99 has no aligned allocation: ask for a little more, start at the next multiple. */
static region allocate_region(uint64_t bytes)
{
    if (bytes > SIZE_MAX - HGRID_ALIGNMENT)
        fail("the grid does not fit into the address space");
    region r;
    r.bytes = (size_t)bytes;
    r.allocation = allocate(r.bytes + HGRID_ALIGNMENT, 1);
    const size_t misplaced = (uintptr_t)r.allocation % HGRID_ALIGNMENT;
    r.start = (unsigned char *)r.allocation + (HGRID_ALIGNMENT - misplaced) % HGRID_ALIGNMENT;
    return r;
}

/* --- the grid -------------------------------------------------------------------------------- */

static void check(hgrid_status status, const hgrid_report *report)
{
    if (status == HGRID_OK)
        return;
    if (report->triangle != HGRID_INVALID_ID)
        fail("triangle %lu: %s", (unsigned long)report->triangle, hgrid_status_string(status));
    fail("%s", hgrid_status_string(status));
}

/* The memory of a grid. */
typedef struct {
    region index, scratch;
} memory;

/* Whether a method knows the size of its index before it writes it. */
static bool is_planned(const hgrid_config *config)
{
    return config->method == HGRID_METHOD_ONE_LEVEL || config->method == HGRID_METHOD_FIXED;
}

/* Asks how much memory the grid takes, and allocates it.
 *
 * The question without scratch says enough for the index, not exactly what it takes: where memory
 * comes in pages, those that are never touched cost nothing. With the methods that find their size
 * while they write, enough is far too much, so they are asked again, with scratch, for up to the
 * time of a build. */
static memory allocate_grid(const hgrid_mesh *mesh, const hgrid_config *config)
{
    hgrid_report report = HGRID_REPORT_INIT;
    check(hgrid_sizes(mesh, config, NULL, 0, &report), &report);
    memory m;
    m.scratch = allocate_region(report.scratch_bytes);
    if (!is_planned(config))
        check(hgrid_sizes(mesh, config, m.scratch.start, m.scratch.bytes, &report), &report);
    m.index = allocate_region(report.index_bytes);
    return m;
}

/* --- vectors --------------------------------------------------------------------------------- */

static vector vector_of(const float v[3])
{
    const vector result = {v[0], v[1], v[2]};
    return result;
}

static double dot(vector a, vector b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static vector cross(vector a, vector b)
{
    const vector v = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return v;
}

static vector scale(vector v, double amount)
{
    const vector result = {v.x * amount, v.y * amount, v.z * amount};
    return result;
}

/* from + amount * along */
static vector offset(vector from, double amount, vector along)
{
    const vector v = {from.x + amount * along.x, from.y + amount * along.y,
                      from.z + amount * along.z};
    return v;
}

/* The vector at length 1, or another one if it has no length. */
static vector unit(vector v, vector otherwise)
{
    const double length = sqrt(dot(v, v));
    const vector result = {v.x / length, v.y / length, v.z / length};
    return length > 0 ? result : otherwise;
}

static void round_to(float to[3], vector v)
{
    to[0] = (float)v.x, to[1] = (float)v.y, to[2] = (float)v.z;
}

/* --- the camera ------------------------------------------------------------------------------ */

/* The tangent of half the field of view, and how much larger than the box the picture is. */
static const float HALF_VIEW_TANGENT = 0.364f;
static const double MARGIN = 1.04;

static double larger(double a, double b)
{
    return a > b ? a : b;
}

/* The box around all finite vertices; without any, the origin. */
static void find_bounds(const scene *s, float min[3], float max[3])
{
    bool is_empty = true;
    for (int axis = 0; axis < 3; axis++)
        min[axis] = max[axis] = 0;
    for (size_t i = 0; i < s->vertex_count; i++) {
        const float *p = s->positions[i];
        if (!isfinite(p[0]) || !isfinite(p[1]) || !isfinite(p[2]))
            continue;
        for (int axis = 0; axis < 3; axis++) {
            min[axis] = is_empty || p[axis] < min[axis] ? p[axis] : min[axis];
            max[axis] = is_empty || p[axis] > max[axis] ? p[axis] : max[axis];
        }
        is_empty = false;
    }
}

/* Stands where all eight corners of the scene's box just fit: in front of it, or above if the scene
 * is flat. */
static camera frame(const scene *s)
{
    float min[3], max[3];
    double middle[3], half[3];
    find_bounds(s, min, max);
    for (int axis = 0; axis < 3; axis++) {
        middle[axis] = 0.5 * min[axis] + 0.5 * max[axis];
        half[axis] = 0.5 * max[axis] - 0.5 * min[axis];
    }

    /* The picture's axes, as seen from the scene. */
    const vector front = {0, 0, 1}, above = {2, 1.5, 3}, level = {1, 0, 0};
    const bool is_flat = half[1] < 0.25 * larger(half[0], half[2]);
    const vector toward_eye = unit(is_flat ? above : front, front);
    const vector sideways = {toward_eye.z, 0, -toward_eye.x};
    const vector right = unit(sideways, level), up = cross(toward_eye, right);

    double distance = 0;
    for (int i = 0; i < 8; i++) {
        const vector corner = {i & 1 ? half[0] : -half[0], i & 2 ? half[1] : -half[1],
                               i & 4 ? half[2] : -half[2]};
        const double reach = larger(fabs(dot(corner, right)), fabs(dot(corner, up)));
        const double depth = dot(corner, toward_eye);
        distance = larger(distance, MARGIN * reach / HALF_VIEW_TANGENT + depth);
    }
    const vector centre = {middle[0], middle[1], middle[2]};
    camera c;
    round_to(c.eye, offset(centre, distance, toward_eye));
    round_to(c.right, right);
    round_to(c.up, up);
    round_to(c.forward, scale(toward_eye, -1));
    return c;
}

/* The ray through the middle of a pixel, counted from the upper left. */
static hgrid_ray ray_of(const camera *c, int column, int row, int size)
{
    const float step = HALF_VIEW_TANGENT / (float)size;
    const float x = (2 * (float)column + 1 - (float)size) * step;
    const float y = ((float)size - 2 * (float)row - 1) * step;
    hgrid_ray ray = {{c->eye[0], c->eye[1], c->eye[2]}, 0, {0, 0, 0}, INFINITY};
    for (int axis = 0; axis < 3; axis++)
        ray.direction[axis] = c->forward[axis] + x * c->right[axis] + y * c->up[axis];
    return ray;
}

/* --- the light ------------------------------------------------------------------------------- */

/* A light from behind the viewer's left shoulder, the sky's and the ground's; the background at the
 * picture's upper and lower edge. All linear red, green, blue. */
static const double KEY[3] = {0.62, 0.60, 0.56};
static const double SKY[3] = {0.09, 0.11, 0.14}, GROUND[3] = {0.03, 0.027, 0.024};
static const double ZENITH[3] = {0.008, 0.018, 0.055}, HORIZON[3] = {0.22, 0.31, 0.44};

static double clamp(double x)
{
    return x < 0 ? 0 : x > 1 ? 1 : x;
}

/* Linear light as a screen wants it; a square root is close to its curve. */
static unsigned char display(double light)
{
    return (unsigned char)(clamp(sqrt(larger(light, 0))) * 255 + 0.5);
}

static void background(const camera *c, const hgrid_ray *ray, unsigned char pixel[3])
{
    const double t = clamp(0.5 + 1.4 * dot(vector_of(ray->direction), vector_of(c->up)));
    for (int i = 0; i < 3; i++)
        pixel[i] = display(HORIZON[i] + (ZENITH[i] - HORIZON[i]) * t);
}

/* A grey surface with two sides. */
static void diffuse(const camera *c, const scene *s, const hgrid_ray *ray, const hgrid_hit *hit,
                    unsigned char pixel[3])
{
    const vector up = vector_of(c->up), toward = scale(vector_of(c->forward), -1);
    const vector from_left = offset(scale(vector_of(c->right), -0.7), 0.8, up);
    const vector light = unit(offset(from_left, 1, toward), toward);

    const uint32_t *corners = s->indices[hit->primitive];
    const vector first = vector_of(s->positions[corners[0]]);
    const vector second = offset(vector_of(s->positions[corners[1]]), -1, first);
    const vector third = offset(vector_of(s->positions[corners[2]]), -1, first);
    const vector face = unit(cross(second, third), toward);
    const vector normal = dot(face, vector_of(ray->direction)) > 0 ? scale(face, -1) : face;

    const double key = larger(dot(normal, light), 0), sky = 0.5 + 0.5 * dot(normal, up);
    for (int i = 0; i < 3; i++)
        pixel[i] = display(key * KEY[i] + sky * SKY[i] + (1 - sky) * GROUND[i]);
}

/* A pixel on its way: ray and hit lie in one struct, and hgrid_intersect_n finds them there. */
typedef struct {
    hgrid_ray ray;
    hgrid_hit hit;
    unsigned char *pixel;
} sample;

/* Finds what the rays of a tile hit, all with one call: neighbours share most of their way. */
static void trace(const hgrid_grid *grid, sample *tile, size_t count)
{
    const hgrid_status status =
        hgrid_intersect_n(grid, &tile->ray, sizeof *tile, &tile->hit, sizeof *tile, count,
                          HGRID_COHERENCE_COHERENT, NULL);
    if (status != HGRID_OK)
        fail("%s", hgrid_status_string(status));
}

/* Paints the pixels of a tile; returns how many rays hit. */
static size_t shade(const scene *s, const camera *c, const sample *tile, size_t count)
{
    size_t hits = 0;
    for (const sample *at = tile; at < tile + count; at++)
        if (at->hit.primitive != HGRID_INVALID_ID) {
            diffuse(c, s, &at->ray, &at->hit, at->pixel);
            hits++;
        } else {
            background(c, &at->ray, at->pixel);
        }
    return hits;
}

/* Shoots a ray for each pixel, tile by tile; returns how many hit. */
static size_t render(const hgrid_grid *grid, const scene *s, const camera *c, int size,
                     unsigned char *pixels)
{
    size_t hits = 0;
    for (int top = 0; top < size; top += TILE)
        for (int left = 0; left < size; left += TILE) {
            /* At the right and lower edge a tile may be smaller. */
            sample tile[TILE * TILE];
            size_t count = 0;
            for (int row = top; row < top + TILE && row < size; row++)
                for (int column = left; column < left + TILE && column < size; column++) {
                    sample *at = &tile[count++];
                    at->ray = ray_of(c, column, row, size);
                    at->pixel = pixels + 3 * ((size_t)row * (size_t)size + (size_t)column);
                }
            trace(grid, tile, count);
            hits += shade(s, c, tile, count);
        }
    return hits;
}

/* --- the program ----------------------------------------------------------------------------- */

/* The methods by their names, with their usual numbers. */
static const struct {
    const char *name;
    hgrid_config config;
} METHODS[] = {
    {"one-level", HGRID_CONFIG_INIT},
    {"fixed", HGRID_CONFIG_INIT_FIXED},
    {"variable", HGRID_CONFIG_INIT_VARIABLE},
    {"recursive", HGRID_CONFIG_INIT_RECURSIVE},
    {"brick", HGRID_CONFIG_INIT_BRICK},
};

enum { METHOD_COUNT = sizeof METHODS / sizeof *METHODS };

typedef struct {
    const char *input, *output;
    int size;
    /* An index of METHODS, and density and cell size if they are not the usual ones. */
    int method;
    double density, cell_size;
} options;

static int parse_size(const char *value)
{
    char *end;
    const long size = strtol(value, &end, 10);
    if (size < 1 || size > MAX_SIZE || *end != '\0')
        fail("--size is a number from 1 to %d, not `%s`", MAX_SIZE, value);
    return (int)size;
}

static int parse_method(const char *value)
{
    for (int i = 0; i < METHOD_COUNT; i++)
        if (strcmp(value, METHODS[i].name) == 0)
            return i;
    fail("--method is one-level, fixed, variable, recursive or brick, not `%s`", value);
    return 0;
}

static double parse_number(const char *option, const char *value)
{
    char *end;
    const double number = strtod(value, &end);
    if (!(number > 0) || *end != '\0')
        fail("%s is a number above 0, not `%s`", option, value);
    return number;
}

static options parse(int count, char **words)
{
    static const char *const known[] = {"-o", "--size", "--method", "--density", "--cell-size"};
    const size_t known_count = sizeof known / sizeof *known;
    options o = {NULL, "raytracer.ppm", DEFAULT_SIZE, 0, 0, 0};
    for (int i = 1; i < count; i++) {
        const char *word = words[i];
        if (word[0] != '-') {
            if (o.input != NULL)
                fail("one scene at a time: %s or %s?", o.input, word);
            o.input = word;
            continue;
        }
        size_t option = 0;
        while (option < known_count && strcmp(word, known[option]) != 0)
            option++;
        if (option == known_count)
            fail("unknown option %s: raytracer [FILE.ply] [--size PIXELS] [--method NAME] "
                 "[--density CELLS] [--cell-size FACTOR] [-o FILE.ppm]",
                 word);
        if (++i == count)
            fail("%s needs a value", word);
        switch (option) {
        case 0: o.output = words[i]; break;
        case 1: o.size = parse_size(words[i]); break;
        case 2: o.method = parse_method(words[i]); break;
        case 3: o.density = parse_number(word, words[i]); break;
        case 4: o.cell_size = parse_number(word, words[i]); break;
        }
    }
    const bool is_brick = METHODS[o.method].config.method == HGRID_METHOD_BRICK;
    if (is_brick ? o.density > 0 : o.cell_size > 0)
        fail("--method %s has no %s", METHODS[o.method].name, is_brick ? "density" : "cell size");
    return o;
}

static double seconds(clock_t from, clock_t to)
{
    return (double)(to - from) / CLOCKS_PER_SEC;
}

int main(int count, char **words)
{
    const options o = parse(count, words);
    scene s = o.input != NULL ? load_ply(o.input) : make_knot();
    FILE *output = fopen(o.output, "wb");
    if (output == NULL)
        fail("%s: cannot be written", o.output);
    const size_t picture_bytes = (size_t)o.size * (size_t)o.size * 3;
    unsigned char *pixels = (unsigned char *)allocate(picture_bytes, 1);

    hgrid_config config = METHODS[o.method].config;
    if (o.density > 0)
        config.density = (float)o.density;
    if (o.cell_size > 0)
        config.cell_size = (float)o.cell_size;
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.positions = s.positions;
    mesh.vertex_count = s.vertex_count;
    mesh.indices = s.indices;
    mesh.triangle_count = s.triangle_count;

    const clock_t start = clock();
    const memory m = allocate_grid(&mesh, &config);
    const clock_t allocated = clock();
    hgrid_grid grid;
    hgrid_report report = HGRID_REPORT_INIT;
    check(hgrid_build(&mesh, &config, m.index.start, m.index.bytes, m.scratch.start,
                      m.scratch.bytes, &grid, &report),
          &report);
    free(m.scratch.allocation);
    const clock_t built = clock();
    const camera c = frame(&s);
    const size_t hits = render(&grid, &s, &c, o.size, pixels);
    const clock_t rendered = clock();

    const bool is_written = fprintf(output, "P6\n%d %d\n255\n", o.size, o.size) > 0 &&
                            fwrite(pixels, 1, picture_bytes, output) == picture_bytes;
    if (fclose(output) != 0 || !is_written)
        fail("%s: cannot be written to the end", o.output);

    printf("scene          %s\n", o.input != NULL ? o.input : "knot, built in");
    printf("triangles      %lu\n", (unsigned long)s.triangle_count);
    printf("skipped        %lu\n", (unsigned long)report.skipped_count);
    printf("method         %s\n", METHODS[o.method].name);
    if (config.method == HGRID_METHOD_BRICK)
        printf("cell size      %g\n", (double)config.cell_size);
    else
        printf("density        %g\n", (double)report.density);
    printf("index bytes    %lu\n", (unsigned long)report.index_bytes);
    printf("scratch bytes  %lu\n", (unsigned long)m.scratch.bytes);
    printf("hits           %lu of %lu rays\n", (unsigned long)hits,
           (unsigned long)(picture_bytes / 3));
    printf("sizes          %.3f s\n", seconds(start, allocated));
    printf("build          %.3f s\n", seconds(allocated, built));
    printf("render         %.3f s\n", seconds(built, rendered));
    printf("time to image  %.3f s\n", seconds(start, rendered));
    printf("wrote %s\n", o.output);

    free(m.index.allocation);
    free(pixels);
    free(s.positions);
    free(s.indices);
    return 0;
}
