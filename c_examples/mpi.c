/*
 * One build, many ranks: the grid goes over MPI, and each rank draws a part of the picture.
 *
 *     mpirun -n 4 mpi                        the built-in scene; the picture goes to mpi.ppm
 *     mpirun -n 4 mpi bunny.ply -o bunny.ppm
 *     mpirun -n 4 mpi --size 256
 *
 * Rank 0 loads the scene and builds. It broadcasts blob and mesh, and every rank opens the blob where it
 * received it. The ranks draw the rows in turn, and rank 0 collects the parts. It then draws all of the
 * picture by itself, compares, and prints the result.
 *
 * Function to read: share_grid. The blob is bytes without pointers, and ranks of the same byte order all open
 * the same grid.
 */

#include "camera.h"
#include "grid.h"
#include "memory.h"
#include "options.h"
#include "picture.h"
#include "render.h"
#include "scene.h"

#include <mpi.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const program_name = "mpi";

/* Ranks take turns in bands of rows, as high as half a tile of render.c. MPI counts with int, so larger data
 * go in pieces. */
enum { BAND = 8, PIECE = 1 << 20, DEFAULT_SIZE = 512 };

static const char USAGE[] = "mpirun -n RANKS mpi [SCENE.ply] [--size PIXELS] [-o FILE.ppm]\n";

typedef struct {
    const char *input, *output;
    int size;
} mpi_options;

static mpi_options parse(int count, char **words)
{
    mpi_options o = {NULL, "mpi.ppm", DEFAULT_SIZE};
    for (int i = 1; i < count; i++) {
        const char *word = words[i];
        if (strcmp(word, "-o") == 0)
            o.output = value_of(count, words, &i);
        else if (strcmp(word, "--size") == 0)
            o.size = parse_count(word, value_of(count, words, &i), 1, MAX_SIZE);
        else if (word[0] == '-')
            fail("unknown option %s: mpi --help names all of them", word);
        else if (o.input != NULL)
            fail("one scene at a time: %s or %s?", o.input, word);
        else
            o.input = word;
    }
    refuse_same(o.input, o.output);
    return o;
}

/* Ends all ranks if this one ends early: the others would wait for ever. */
static void end_all(void)
{
    int is_over = 0;
    MPI_Finalized(&is_over);
    if (!is_over)
        MPI_Abort(MPI_COMM_WORLD, 1);
}

/* --- from rank 0 to all ---------------------------------------------------------------------- */

static void broadcast(void *from, size_t bytes)
{
    unsigned char *at = (unsigned char *)from;
    for (size_t done = 0; done < bytes; done += PIECE) {
        const size_t left = bytes - done;
        MPI_Bcast(at + done, left < PIECE ? (int)left : PIECE, MPI_BYTE, 0, MPI_COMM_WORLD);
    }
}

/* The data that every rank has at the end. */
typedef struct {
    scene scene;
    region blob;
    hgrid_grid grid;
} shared_grid;

/* Sends the data of rank 0 to the others: first sizes, for which they allocate memory, then the bytes. */
static void share_grid(int rank, shared_grid *g)
{
    uint64_t sizes[3] = {g->blob.bytes, g->scene.vertex_count, g->scene.triangle_count};
    broadcast(sizes, sizeof sizes);
    if (rank != 0) {
        g->blob = allocate_region(sizes[0]);
        g->scene.vertex_count = (size_t)sizes[1];
        g->scene.triangle_count = (size_t)sizes[2];
        g->scene.positions =
            (float(*)[3])allocate(g->scene.vertex_count, sizeof *g->scene.positions);
        g->scene.indices =
            (uint32_t(*)[3])allocate(g->scene.triangle_count, sizeof *g->scene.indices);
    }
    broadcast(g->blob.start, g->blob.bytes);
    broadcast(g->scene.positions, g->scene.vertex_count * sizeof *g->scene.positions);
    broadcast(g->scene.indices, g->scene.triangle_count * sizeof *g->scene.indices);
    const hgrid_mesh mesh = mesh_of(&g->scene);
    check(hgrid_open(g->blob.start, g->blob.bytes, &mesh, &g->grid), NULL);
}

/* --- and back -------------------------------------------------------------------------------- */

/* Draws every step-th band of the picture, from the first one on. */
static void draw_bands(const shared_grid *g, int size, int first, int step, unsigned char *pixels)
{
    const camera c = frame(&g->scene);
    for (int row = first * BAND; row < size; row += step * BAND) {
        picture_job job;
        memset(&job, 0, sizeof job);
        job.grid = &g->grid, job.camera = &c;
        job.size = size, job.first_row = row;
        job.row_count = size - row < BAND ? size - row : BAND;
        job.has_shadows = true;
        job.pixels = pixels + 3 * (size_t)row * (size_t)size;
        job.threads = 1;
        render(&job);
    }
}

/* Combines the parts at rank 0 by or: rows that a rank did not draw are 0. */
static void gather(int rank, unsigned char *pixels, size_t bytes)
{
    for (size_t done = 0; done < bytes; done += PIECE) {
        const int piece = bytes - done < PIECE ? (int)(bytes - done) : PIECE;
        MPI_Reduce(rank == 0 ? MPI_IN_PLACE : pixels + done, rank == 0 ? pixels + done : NULL,
                   piece, MPI_BYTE, MPI_BOR, 0, MPI_COMM_WORLD);
    }
}

static unsigned char *allocate_picture(size_t bytes)
{
    unsigned char *pixels = (unsigned char *)allocate(bytes, 1);
    memset(pixels, 0, bytes);
    return pixels;
}

/* --- the program ----------------------------------------------------------------------------- */

/* Builds at rank 0, before the other ranks have work. */
static void build(shared_grid *g)
{
    const hgrid_mesh mesh = mesh_of(&g->scene);
    const hgrid_config config = HGRID_CONFIG_INIT;
    const built_grid b = build_grid(&mesh, &config, 1, NULL);
    g->blob = b.index;
    g->blob.bytes = (size_t)b.report.index_bytes;
}

int main(int count, char **words)
{
    int rank, ranks;
    for (int i = 1; i < count; i++)
        if (strcmp(words[i], "--help") == 0)
            return fputs(USAGE, stdout) < 0;
    MPI_Init(&count, &words);
    atexit(end_all);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);

    mpi_options o = {NULL, NULL, 0};
    shared_grid g;
    memset(&g, 0, sizeof g);
    FILE *output = NULL;
    if (rank == 0) {
        o = parse(count, words);
        g.scene = load_scene(o.input);
        output = open_picture(o.output);
        build(&g);
    }
    broadcast(&o.size, sizeof o.size);
    share_grid(rank, &g);

    const size_t bytes = 3 * (size_t)o.size * (size_t)o.size;
    unsigned char *pixels = allocate_picture(bytes);
    draw_bands(&g, o.size, rank, ranks, pixels);
    gather(rank, pixels, bytes);

    if (rank == 0) {
        unsigned char *alone = allocate_picture(bytes);
        draw_bands(&g, o.size, 0, 1, alone);
        if (memcmp(alone, pixels, bytes) != 0)
            fail("the picture of %d ranks is not the picture of one", ranks);
        write_picture(output, o.output, o.size, o.size, pixels);
        printf("shared     %lu bytes of grid for %lu triangles\n", (unsigned long)g.blob.bytes,
               (unsigned long)g.scene.triangle_count);
        printf("drawn      %s, ranks: %d\n", o.output, ranks);
        printf("compared   with the picture of one process: the same, byte by byte\n");
        free(alone);
    }
    free(pixels);
    free(g.blob.allocation);
    free(g.scene.positions);
    free(g.scene.indices);
    MPI_Finalize();
    return 0;
}
