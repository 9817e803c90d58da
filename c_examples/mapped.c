/*
 * One build, several processes: the grid goes to a file, and each process maps it.
 *
 *     mapped GRID_FILE                       the built-in scene; the picture goes to mapped.ppm
 *     mapped GRID_FILE bunny.ply -o bunny.ppm
 *     mapped GRID_FILE --size 256
 *
 * The first process builds and writes GRID_FILE, which must not exist and is removed at the end. Two more
 * processes map it read-only, so that both share the same pages and none is copied; each draws half of the
 * picture into the picture's file. The first process then draws all of it from its own memory, compares, and
 * prints the result.
 *
 * Functions to read: store and map. A packed blob is grid and mesh without pointers, so it works at any
 * aligned address, and opening it takes next to no time.
 */

/* mmap, fork and the like are POSIX, not C. */
#define _POSIX_C_SOURCE 200809L

#include "camera.h"
#include "grid.h"
#include "memory.h"
#include "options.h"
#include "picture.h"
#include "render.h"
#include "scene.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

const char *const program_name = "mapped";

enum { PROCESSES = 2, DEFAULT_SIZE = 512 };

static const char USAGE[] =
    "mapped GRID_FILE [SCENE.ply] [--size PIXELS] [-o FILE.ppm]\n"
    "GRID_FILE must not exist; it is removed in the end\n";

typedef struct {
    const char *grid_file, *input, *output;
    int size;
} mapped_options;

static mapped_options parse(int count, char **words)
{
    mapped_options o = {NULL, NULL, "mapped.ppm", DEFAULT_SIZE};
    for (int i = 1; i < count; i++) {
        const char *word = words[i];
        if (strcmp(word, "--help") == 0) {
            fputs(USAGE, stdout);
            exit(0);
        } else if (strcmp(word, "-o") == 0)
            o.output = value_of(count, words, &i);
        else if (strcmp(word, "--size") == 0)
            o.size = parse_count(word, value_of(count, words, &i), 1, MAX_SIZE);
        else if (word[0] == '-')
            fail("unknown option %s: mapped --help names all of them", word);
        else if (o.grid_file == NULL)
            o.grid_file = word;
        else if (o.input == NULL)
            o.input = word;
        else
            fail("one grid file and one scene at a time, and then %s?", word);
    }
    if (o.grid_file == NULL)
        fail("where may the grid go? mapped GRID_FILE, a file that does not exist yet");
    refuse_same(o.input, o.output);
    refuse_same(o.grid_file, o.output);
    return o;
}

/* --- the grid's file ------------------------------------------------------------------------- */

/* The file that this process removes when it ends, unless a signal ends it. */
static const char *stored;
static pid_t owner;

static void remove_stored(void)
{
    if (stored != NULL && getpid() == owner)
        remove(stored);
}

/* Writes all bytes, or ends the program. */
static void write_at(int file, const char *path, size_t offset, const void *from, size_t bytes)
{
    const unsigned char *at = (const unsigned char *)from;
    while (bytes > 0) {
        const ssize_t written = pwrite(file, at, bytes, (off_t)offset);
        if (written < 0 && errno == EINTR)
            continue;
        if (written <= 0)
            fail("%s: cannot be written to the end: %s", path, strerror(errno));
        at += written, offset += (size_t)written, bytes -= (size_t)written;
    }
}

/* Packs grid and mesh into one blob and writes it; returns its size. */
static size_t store(const char *path, const hgrid_grid *grid)
{
    uint64_t bytes = 0;
    if (hgrid_pack(grid, NULL, 0, &bytes) != HGRID_ERROR_INDEX_TOO_SMALL)
        fail("the grid cannot be packed");
    const region packed = allocate_region(bytes);
    check(hgrid_pack(grid, packed.start, packed.bytes, &bytes), NULL);

    /* O_EXCL: an existing file must be neither overwritten nor removed. */
    const int file = open(path, O_WRONLY | O_CREAT | O_EXCL, 0600);
    if (file < 0 && errno == EEXIST)
        fail("%s: exists already: name a file that may be made, and removed in the end", path);
    if (file < 0)
        fail("%s: cannot be made: %s", path, strerror(errno));
    stored = path, owner = getpid();
    atexit(remove_stored);
    write_at(file, path, 0, packed.start, packed.bytes);
    if (close(file) != 0)
        fail("%s: cannot be written to the end: %s", path, strerror(errno));
    free(packed.allocation);
    return packed.bytes;
}

/* Computes the camera from the mesh, which the blob contains: tight arrays, with indices of 32 bits. */
static camera camera_of(const hgrid_grid *grid)
{
    hgrid_mesh mesh = HGRID_MESH_INIT;
    check(hgrid_mesh_of(grid, &mesh), NULL);
    const scene s = {(float(*)[3])mesh.positions, mesh.vertex_count, (uint32_t(*)[3])mesh.indices,
                     mesh.triangle_count};
    return frame(&s);
}

/* Maps the file and opens the grid in it: pages are read only when a ray needs them.
 *
 * A trusted process has just written this file, and no other process changes it. Do not map a file that
 * others may write. hgrid_validate would prove that the blob is sound. */
static hgrid_grid map(const char *path)
{
    struct stat status;
    const int file = open(path, O_RDONLY);
    if (file < 0 || fstat(file, &status) != 0)
        fail("%s: cannot be opened: %s", path, strerror(errno));
    const size_t bytes = (size_t)status.st_size;
    void *blob = mmap(NULL, bytes, PROT_READ, MAP_PRIVATE, file, 0);
    if (blob == MAP_FAILED)
        fail("%s: cannot be mapped: %s", path, strerror(errno));
    close(file);

    hgrid_grid grid;
    check(hgrid_open(blob, bytes, NULL, &grid), NULL);
    return grid;
}

/* --- the picture ----------------------------------------------------------------------------- */

/* Returns the rows from `first` to before `end`, three bytes for each pixel; the caller frees them. */
static unsigned char *draw_rows(const hgrid_grid *grid, int size, int first, int end)
{
    const camera c = camera_of(grid);
    picture_job job;
    memset(&job, 0, sizeof job);
    job.grid = grid, job.camera = &c;
    job.size = size, job.first_row = first, job.row_count = end - first;
    job.has_shadows = true;
    job.pixels = (unsigned char *)allocate((size_t)size * (size_t)job.row_count, 3);
    job.threads = 1;
    render(&job);
    return job.pixels;
}

/* Draws a part in another process: from the grid's file to rows in the picture's file. It only needs the
 * names of the two, so it could be another program. */
static void draw_part(const mapped_options *o, size_t header_bytes, int part)
{
    const int first = o->size * part / PROCESSES, end = o->size * (part + 1) / PROCESSES;
    const size_t row_bytes = 3 * (size_t)o->size;
    const hgrid_grid grid = map(o->grid_file);
    unsigned char *pixels = draw_rows(&grid, o->size, first, end);
    const int picture = open(o->output, O_WRONLY);
    if (picture < 0)
        fail("%s: cannot be written: %s", o->output, strerror(errno));
    write_at(picture, o->output, header_bytes + (size_t)first * row_bytes, pixels,
             (size_t)(end - first) * row_bytes);
    if (close(picture) != 0)
        fail("%s: cannot be written to the end: %s", o->output, strerror(errno));
    free(pixels);
}

/* Starts the processes and waits for them. */
static void draw_in_processes(const mapped_options *o, size_t header_bytes)
{
    pid_t children[PROCESSES];
    fflush(NULL);
    for (int part = 0; part < PROCESSES; part++) {
        children[part] = fork();
        if (children[part] < 0)
            fail("no process for part %d of the picture: %s", part, strerror(errno));
        if (children[part] == 0) {
            draw_part(o, header_bytes, part);
            _exit(0);
        }
    }
    int failures = 0;
    for (int part = 0; part < PROCESSES; part++) {
        int status = 0;
        while (waitpid(children[part], &status, 0) < 0 && errno == EINTR)
            continue;
        failures += !WIFEXITED(status) || WEXITSTATUS(status) != 0;
    }
    if (failures > 0)
        fail("%d of %d processes failed", failures, PROCESSES);
}

static bool is_equal(const char *path, size_t header_bytes, const unsigned char *pixels,
                     size_t bytes)
{
    unsigned char *read = (unsigned char *)allocate(bytes, 1);
    FILE *file = fopen(path, "rb");
    if (file == NULL || fseek(file, (long)header_bytes, SEEK_SET) != 0 ||
        fread(read, 1, bytes, file) != bytes)
        fail("%s: cannot be read", path);
    fclose(file);
    const bool equal = memcmp(read, pixels, bytes) == 0;
    free(read);
    return equal;
}

int main(int count, char **words)
{
    const mapped_options o = parse(count, words);
    scene s = load_scene(o.input);
    const hgrid_mesh mesh = mesh_of(&s);
    const hgrid_config config = HGRID_CONFIG_INIT;
    built_grid b = build_grid(&mesh, &config, 1, NULL);
    const size_t stored_bytes = store(o.grid_file, &b.grid);
    printf("stored     %lu bytes: %lu of grid, and a mesh of %lu triangles\n",
           (unsigned long)stored_bytes, (unsigned long)b.report.index_bytes,
           (unsigned long)s.triangle_count);

    FILE *output = open_picture(o.output);
    const int header_bytes = fprintf(output, "P6\n%d %d\n255\n", o.size, o.size);
    if (header_bytes < 0 || fclose(output) != 0)
        fail("%s: cannot be written to the end", o.output);
    draw_in_processes(&o, (size_t)header_bytes);
    printf("drawn      %s, processes: %d\n", o.output, PROCESSES);

    unsigned char *pixels = draw_rows(&b.grid, o.size, 0, o.size);
    const size_t bytes = 3 * (size_t)o.size * (size_t)o.size;
    if (!is_equal(o.output, (size_t)header_bytes, pixels, bytes))
        fail("%s is not the picture that one process draws", o.output);
    printf("compared   with the picture of one process: the same, byte by byte\n");

    free(pixels);
    free(b.index.allocation);
    free(s.positions);
    free(s.indices);
    return 0;
}
