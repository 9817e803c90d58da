#include "render.h"

#include "grid.h"
#include "light.h"
#include "threads.h"

#include <pthread.h>
#include <string.h>

/* Rays are traced in tiles of 16 x 16 pixels, all rays of a tile in one call. Rays toward the sky go in calls
 * of at most MOST_PROBES. */
enum { TILE = 16, TILE_PIXELS = TILE * TILE, MOST_PROBES = 4 * TILE_PIXELS };

/* With occlusion the sky is brighter, because part of it is hidden. */
static const double OPEN_SKY_GAIN = 2.2;

/* The distance within which surfaces hide the sky, in parts of the scene's radius. */
static const double SKY_REACH = 0.5;

/* A pixel with its ray and its hit in one struct, where hgrid_intersect_n finds them. */
typedef struct {
    hgrid_ray ray;
    hgrid_hit hit;
    /* The pixel's place in the whole picture and in the job's rows. */
    uint32_t number;
    size_t place;
    hgrid_surface at;
    double lit, open;
} sample;

/* A ray from a hit towards light, and its answer: 1 if something is in the way. */
typedef struct {
    hgrid_ray ray;
    uint8_t is_occluded;
    sample *of;
} probe;

/* The data of all threads: the number of the next tile, the tiles done, and the counts. */
typedef struct {
    const picture_job *job;
    lights lights;
    size_t columns, tile_count;
    pthread_mutex_t lock;
    size_t next, done, hits;
} shared;

/* --- the steps of a tile --------------------------------------------------------------------- */

/* Traces the rays of a tile with one call: neighbours share most of their way. */
static void trace(const shared *s, sample *tile, size_t count, const hgrid_query_options *options)
{
    check(hgrid_intersect_n(s->job->grid, &tile->ray, sizeof *tile, &tile->hit, sizeof *tile, count,
                            HGRID_COHERENCE_COHERENT, options),
          NULL);
}

static bool is_hit(const sample *at)
{
    return at->hit.primitive != HGRID_INVALID_ID;
}

static probe probe_of(sample *of, vector toward, float reach)
{
    probe p = {{{0, 0, 0}, 0, {0, 0, 0}, reach}, 0, of};
    memcpy(p.ray.origin, of->at.above, sizeof p.ray.origin);
    round_to(p.ray.direction, toward);
    return p;
}

/* Traces all probes with one call. Their directions may differ: they come in the order of the tile's pixels,
 * so successive probes start near each other. */
static void send(const shared *s, probe *probes, size_t count, const hgrid_query_options *options)
{
    if (count == 0)
        return;
    check(hgrid_occluded_n(s->job->grid, &probes->ray, sizeof *probes, &probes->is_occluded,
                           sizeof *probes, count, HGRID_COHERENCE_COHERENT, options),
          NULL);
}

/* Traces shadow rays, from hits that face the lamp. */
static void look_for_lamp(const shared *s, sample *tile, size_t count,
                          const hgrid_query_options *options)
{
    probe probes[TILE_PIXELS];
    size_t probe_count = 0;
    for (sample *at = tile; at < tile + count; at++)
        if (is_hit(at) && lamp_on(&s->lights, vector_of(at->at.normal)) > 0)
            probes[probe_count++] = probe_of(at, s->lights.toward_lamp, INFINITY);
    send(s, probes, probe_count, options);
    for (const probe *p = probes; p < probes + probe_count; p++)
        p->of->lit = !p->is_occluded;
}

/* Sends some of the rays of a tile toward the sky, and adds up the light. */
static void send_to_sky(const shared *s, probe *probes, size_t count,
                        const hgrid_query_options *options)
{
    send(s, probes, count, options);
    for (const probe *p = probes; p < probes + count; p++)
        p->of->open += p->is_occluded ? 0 : 1.0 / s->job->sky_rays;
}

/* Computes ambient occlusion: the part of the sky and the ground that a hit sees. */
static void look_for_sky(const shared *s, sample *tile, size_t count,
                         const hgrid_query_options *options)
{
    const int rays = s->job->sky_rays;
    const float reach = (float)(SKY_REACH * s->job->camera->scene_radius);
    probe probes[MOST_PROBES];
    size_t probe_count = 0;
    for (sample *at = tile; at < tile + count; at++) {
        at->open = 0;
        for (int i = 0; i < rays && is_hit(at); i++) {
            if (probe_count == MOST_PROBES) {
                send_to_sky(s, probes, probe_count, options);
                probe_count = 0;
            }
            probes[probe_count++] =
                probe_of(at, scatter(vector_of(at->at.normal), at->number, i, rays), reach);
        }
    }
    send_to_sky(s, probes, probe_count, options);
}

/* Paints the pixels of a tile; returns the number of rays that hit. */
static size_t paint(const shared *s, const sample *tile, size_t count)
{
    size_t hits = 0;
    for (const sample *at = tile; at < tile + count; at++) {
        unsigned char *pixel = s->job->pixels + 3 * at->place;
        if (is_hit(at)) {
            paint_surface(&s->lights, vector_of(at->at.normal), at->lit, at->open, pixel);
            hits++;
        } else {
            paint_background(&s->lights, &at->ray, pixel);
        }
    }
    return hits;
}

/* Draws the pixels of a tile, or some of them; returns the number of camera rays that hit. */
static size_t draw(const shared *s, sample *tile, size_t count, const hgrid_query_options *options)
{
    trace(s, tile, count, options);
    for (sample *at = tile; at < tile + count; at++)
        if (is_hit(at) && !hgrid_surface_at(s->job->grid, &at->ray, &at->hit, &at->at))
            fail("a hit that the grid does not know");
    if (s->job->has_shadows)
        look_for_lamp(s, tile, count, options);
    if (s->job->sky_rays > 0)
        look_for_sky(s, tile, count, options);
    return paint(s, tile, count);
}

/* Draws the pixels of a tile one by one, to count the cost of each. */
static size_t draw_and_count(const shared *s, sample *tile, size_t count)
{
    const picture_job *job = s->job;
    size_t hits = 0;
    for (sample *at = tile; at < tile + count; at++) {
        hgrid_counters counters = {0, 0, 0};
        hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
        options.counters = &counters;
        hits += draw(s, at, 1, &options);
        if (job->tests != NULL)
            job->tests[at->place] = (uint32_t)counters.primitive_tests;
        if (job->steps != NULL)
            job->steps[at->place] = (uint32_t)counters.cell_steps;
    }
    return hits;
}

/* --- tiles ----------------------------------------------------------------------------------- */

/* Packs every other bit of a number. */
static int even_bits(int number)
{
    return (number & 1) | (number >> 1 & 2) | (number >> 2 & 4) | (number >> 3 & 8);
}

/* Makes the rays of a tile in the order that hgrid_intersect_n likes best. Every 16 rays form a square of
   pixels, and so do every 64. Every 128 form two squares of 64 side by side. At the right and lower edge a
   tile may be smaller. */
static size_t aim(const shared *s, size_t number, sample *tile)
{
    const picture_job *job = s->job;
    const int left = (int)(number % s->columns) * TILE, top = (int)(number / s->columns) * TILE;
    size_t count = 0;
    for (int ray = 0; ray < TILE_PIXELS; ray++) {
        const int column = left + even_bits(ray), row = top + even_bits(ray >> 1);
        if (row >= job->row_count || column >= job->size)
            continue;
        sample *at = &tile[count++];
        at->ray = ray_of(job->camera, column, job->first_row + row, job->size);
        at->number = (uint32_t)(job->first_row + row) * (uint32_t)job->size + (uint32_t)column;
        at->place = (size_t)row * (size_t)job->size + (size_t)column;
        at->lit = at->open = 1;
    }
    return count;
}

/* Adds the hits of a thread's tile, if it had one, and takes the number of the next. */
static size_t take(shared *s, bool had_tile, size_t hits)
{
    pthread_mutex_lock(&s->lock);
    const size_t number = s->next;
    s->next += number < s->tile_count;
    s->done += had_tile;
    s->hits += hits;
    if (s->job->progress != NULL)
        show_progress(s->job->progress, (double)s->done / (double)s->tile_count);
    pthread_mutex_unlock(&s->lock);
    return number;
}

/* Draws tiles in a thread until none is left. One thread writes each pixel, and its colour depends only on
 * its place, so the picture does not depend on the threads. */
static void draw_tiles(void *context, uint32_t thread)
{
    shared *s = (shared *)context;
    const bool is_counting = s->job->tests != NULL || s->job->steps != NULL;
    (void)thread;
    size_t number = take(s, false, 0);
    while (number < s->tile_count) {
        sample tile[TILE_PIXELS];
        const size_t count = aim(s, number, tile);
        const size_t hits =
            is_counting ? draw_and_count(s, tile, count) : draw(s, tile, count, NULL);
        number = take(s, true, hits);
    }
}

size_t render(const picture_job *job)
{
    const size_t columns = ((size_t)job->size + TILE - 1) / TILE;
    const size_t rows = ((size_t)job->row_count + TILE - 1) / TILE;
    if (columns == 0 || rows == 0)
        return 0;
    shared s = {job, lights_of(job->camera, job->sky_rays > 0 ? OPEN_SKY_GAIN : 1),
                columns, columns * rows, PTHREAD_MUTEX_INITIALIZER, 0, 0, 0};
    run_on_threads(NULL, job->threads, draw_tiles, &s);
    pthread_mutex_destroy(&s.lock);
    return s.hits;
}
