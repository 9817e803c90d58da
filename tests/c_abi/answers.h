/* Reads the table of queries that cases.rs writes, runs all of them, and compares the answers. answers.c and
 * answers.cpp include this: before it they define `grid_view`, and after it the functions that are declared
 * here. */
#ifndef ANSWERS_H
#define ANSWERS_H

#include "check.h"

enum { RAYS_AT_MOST = 160, HITS_AT_MOST = 256, GROUPS_AT_MOST = 8 };

/* Options, and for each ray the hits that they offer to a filter. */
typedef struct {
    uint32_t mask, cull, skip, rule;
    const hgrid_hit *offered[RAYS_AT_MOST];
    uint32_t counts[RAYS_AT_MOST];
} group;

/* A point query with its answer. */
typedef struct {
    float point[3], max;
    uint32_t mask, skip, is_found;
    hgrid_closest closest;
} point_question;

/* A mesh with its queries. */
typedef struct {
    hgrid_mesh mesh;
    uint32_t ray_count, group_count, point_count, config_count;
    const hgrid_ray *rays;
    group groups[GROUPS_AT_MOST];
    const point_question *points;
} test_case;

/* Three views of the same grid: built, opened from a copy of its bytes, and from a packed blob. */
enum { VIEWS = 3 };

/* The number of hits that a filter was offered so far: for one ray, or for each ray of a batch. */
typedef struct {
    const group *of;
    bool is_batch;
    size_t ray;
    uint32_t offered[RAYS_AT_MOST];
} offers;

/* The options of a query: none, or those of a group. */
typedef struct {
    const group *of;
    offers *seen;
    hgrid_counters *counters;
} asked;

static void make_views(const hgrid_mesh *mesh, const hgrid_config *config, const void *blob,
                       size_t blob_bytes, grid_view views[VIEWS]);
static bool ask_closest_hit(const grid_view *view, const asked *how, const hgrid_ray *ray,
                            hgrid_hit *hit);
static bool ask_any_hit(const grid_view *view, const asked *how, const hgrid_ray *ray);
static size_t ask_all_hits(const grid_view *view, const asked *how, const hgrid_ray *ray,
                           hgrid_hit *hits, size_t room);
static void ask_closest_hits(const grid_view *view, const asked *how, const hgrid_ray *rays,
                             size_t ray_stride, hgrid_hit *hits, size_t hit_stride, size_t count,
                             hgrid_coherence coherence);
static void ask_any_hits(const grid_view *view, const asked *how, const hgrid_ray *rays,
                         size_t ray_stride, uint8_t *occluded, size_t stride, size_t count,
                         hgrid_coherence coherence);
static bool ask_closest_point(const grid_view *view, const asked *how, const float point[3],
                              float max, hgrid_closest *closest);

/* The number of answers compared. */
static size_t answer_count;

#define CHECK_ANSWER(condition) \
    do { \
        CHECK(condition); \
        answer_count++; \
    } while (0)

/* Returns the verdict of a rule's filter, as cases.rs defines it. */
static hgrid_verdict verdict_of(uint32_t rule, uint32_t primitive)
{
    if (rule == 2 && primitive % 5 == 0)
        return HGRID_ACCEPT_AND_STOP;
    if (rule == 2 && primitive % 4 == 0)
        return HGRID_REJECT;
    if (rule == 1 && primitive % 2 == 0)
        return HGRID_REJECT;
    /* An unknown verdict counts as a rejection. */
    if (rule == 3 && primitive % 2 == 0)
        return primitive + 3;
    return HGRID_ACCEPT;
}

/* Checks what a filter is offered: hits in order, none twice, with the index of their ray. */
static hgrid_verdict offer(offers *seen, size_t place, const hgrid_hit *hit)
{
    CHECK(seen->is_batch || place == 0);
    const size_t ray = seen->is_batch ? place : seen->ray;
    CHECK(ray < RAYS_AT_MOST && seen->offered[ray] < seen->of->counts[ray]);
    const hgrid_hit *expected = &seen->of->offered[ray][seen->offered[ray]++];
    CHECK(memcmp(expected, hit, sizeof *hit) == 0);
    return verdict_of(seen->of->rule, hit->primitive);
}

/* The offered hits of a ray that count, the number of offers until one counts, and the number of offers of a
 * query for all hits. */
typedef struct {
    hgrid_hit hits[HITS_AT_MOST];
    uint32_t count, until_first, until_all;
} expectation;

static void expect(const group *g, size_t ray, expectation *e)
{
    hgrid_verdict verdict = HGRID_REJECT;
    uint32_t i;
    e->count = e->until_first = 0;
    for (i = 0; i < g->counts[ray] && verdict != HGRID_ACCEPT_AND_STOP; i++) {
        const hgrid_hit *hit = &g->offered[ray][i];
        verdict = g->rule == 0 ? HGRID_ACCEPT : verdict_of(g->rule, hit->primitive);
        if (verdict == HGRID_ACCEPT || verdict == HGRID_ACCEPT_AND_STOP) {
            CHECK(e->count < HITS_AT_MOST);
            e->hits[e->count++] = *hit;
            if (e->count == 1)
                e->until_first = i + 1;
        }
    }
    e->until_all = g->rule == 0 ? 0 : i;
    if (e->count == 0)
        e->until_first = i;
    if (g->rule == 0)
        e->until_first = 0;
}

static void start(offers *seen, const group *g, bool is_batch, size_t ray)
{
    memset(seen, 0, sizeof *seen);
    seen->of = g, seen->is_batch = is_batch, seen->ray = ray;
}

/* Checks every query of one ray. */
static void check_ray(const grid_view *view, const test_case *c, const group *g, size_t ray,
                      hgrid_counters work[2])
{
    static expectation e;
    static hgrid_hit hits[HITS_AT_MOST + 1];
    static offers seen;
    hgrid_hit hit;
    const hgrid_ray *along = &c->rays[ray];
    asked how = {g, &seen, NULL}, plainly = {NULL, NULL, NULL};
    expect(g, ray, &e);

    /* The first group's options are the defaults. */
    for (int with = g == c->groups ? 0 : 1; with < 2; with++) {
        const asked *as = with ? &how : &plainly;
        start(&seen, g, false, ray);
        memset(&hit, 0xc7, sizeof hit);
        how.counters = &work[0];
        CHECK_ANSWER(ask_closest_hit(view, as, along, &hit) == (e.count > 0));
        CHECK(e.count > 0 ? memcmp(&hit, e.hits, sizeof hit) == 0
                          : all_bytes_are(&hit, sizeof hit, 0xc7));
        CHECK(seen.offered[ray] == (with ? e.until_first : 0));

        start(&seen, g, false, ray);
        how.counters = &work[1];
        CHECK_ANSWER(ask_any_hit(view, as, along) == (e.count > 0));
        CHECK(seen.offered[ray] == (with ? e.until_first : 0));

        how.counters = NULL;
        const size_t rooms[] = {0, 1, 17, e.count, e.count + 1};
        for (size_t i = 0; i < sizeof rooms / sizeof *rooms; i++) {
            const size_t room = rooms[i], written = room < e.count ? room : e.count;
            start(&seen, g, false, ray);
            memset(hits, 0xc7, (room + 1) * sizeof *hits);
            CHECK_ANSWER(ask_all_hits(view, as, along, hits, room) == e.count);
            CHECK(memcmp(hits, e.hits, written * sizeof *hits) == 0);
            CHECK(all_bytes_are(hits + written, (room + 1 - written) * sizeof *hits, 0xc7));
            CHECK(seen.offered[ray] == (with ? e.until_all : 0));
        }
    }
}

/* A ray with its answers, as a renderer may keep them. */
typedef struct {
    uint8_t occluded;
    char pad[6];
    hgrid_ray ray;
    hgrid_hit hit;
    uint32_t pixel;
} path;

/* Checks batches of all rays, in contiguous arrays and in structs. */
static void check_batches(const grid_view *view, const test_case *c, const group *g)
{
    static const hgrid_hit miss = {INFINITY, 0, 0, HGRID_INVALID_ID};
    static expectation e;
    static path paths[RAYS_AT_MOST];
    static hgrid_hit hits[RAYS_AT_MOST];
    static uint8_t occluded[RAYS_AT_MOST];
    static offers seen;
    const asked how = {g, &seen, NULL}, plainly = {NULL, NULL, NULL};
    const size_t n = c->ray_count, stride = sizeof *paths;
    for (int with = g == c->groups ? 0 : 1; with < 2; with++)
        for (hgrid_coherence coherence = 0; coherence < 2; coherence++) {
            const asked *as = with ? &how : &plainly;
            memset(paths, 0xc7, sizeof paths), memset(hits, 0xc7, sizeof hits);
            memset(occluded, 0xc7, sizeof occluded);
            for (size_t i = 0; i < n; i++)
                paths[i].ray = c->rays[i];
            start(&seen, g, true, 0);
            ask_closest_hits(view, as, c->rays, sizeof *c->rays, hits, sizeof *hits, n, coherence);
            for (size_t i = 0; i < n; i++) {
                expect(g, i, &e);
                CHECK_ANSWER(memcmp(&hits[i], e.count > 0 ? e.hits : &miss, sizeof miss) == 0);
                CHECK(seen.offered[i] == (with ? e.until_first : 0));
            }
            start(&seen, g, true, 0);
            ask_any_hits(view, as, c->rays, sizeof *c->rays, occluded, 1, n, coherence);
            start(&seen, g, true, 0);
            ask_closest_hits(view, as, &paths->ray, stride, &paths->hit, stride, n, coherence);
            start(&seen, g, true, 0);
            ask_any_hits(view, as, &paths->ray, stride, &paths->occluded, stride, n, coherence);
            for (size_t i = 0; i < n; i++) {
                const bool is_hit = hits[i].primitive != HGRID_INVALID_ID;
                CHECK_ANSWER(occluded[i] == is_hit && paths[i].occluded == is_hit);
                CHECK_ANSWER(memcmp(&paths[i].hit, &hits[i], sizeof *hits) == 0);
                CHECK(all_bytes_are(paths[i].pad, sizeof paths[i].pad, 0xc7));
                CHECK(paths[i].pixel == 0xc7c7c7c7u);
            }
        }
}

static void check_points(const grid_view *view, const test_case *c)
{
    for (uint32_t i = 0; i < c->point_count; i++) {
        const point_question *p = &c->points[i];
        group g = c->groups[0];
        static offers seen;
        hgrid_closest closest;
        g.mask = p->mask, g.skip = p->skip;
        const asked how = {&g, &seen, NULL};
        memset(&closest, 0xc7, sizeof closest);
        CHECK_ANSWER(ask_closest_point(view, &how, p->point, p->max, &closest) == p->is_found);
        CHECK(p->is_found ? memcmp(&closest, &p->closest, sizeof closest) == 0
                          : all_bytes_are(&closest, sizeof closest, 0xc7));
    }
}

/* A position in the table. */
typedef struct {
    const unsigned char *at;
} table;

static const void *next(table *t, size_t bytes)
{
    const void *at = t->at;
    t->at += bytes;
    return at;
}

static uint32_t next_word(table *t)
{
    uint32_t word;
    memcpy(&word, next(t, sizeof word), sizeof word);
    return word;
}

/* Returns the same mesh in elements without alignment, with indices of 16 bits. */
static hgrid_mesh scattered(const hgrid_mesh *mesh)
{
    const size_t strides[] = {13, 7, 5};
    unsigned char *positions = (unsigned char *)guarded(mesh->vertex_count * strides[0]);
    unsigned char *indices = (unsigned char *)guarded(mesh->triangle_count * strides[1]);
    unsigned char *masks = (unsigned char *)guarded(mesh->triangle_count * strides[2]);
    hgrid_mesh other = *mesh;
    for (size_t i = 0; i < mesh->vertex_count; i++)
        memcpy(positions + i * strides[0], (const float *)mesh->positions + 3 * i, 12);
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        const uint32_t *corners = (const uint32_t *)mesh->indices + 3 * i;
        const uint16_t small[3] = {(uint16_t)corners[0], (uint16_t)corners[1],
                                   (uint16_t)corners[2]};
        memcpy(indices + i * strides[1], small, sizeof small);
        if (mesh->masks != NULL)
            memcpy(masks + i * strides[2], (const uint32_t *)mesh->masks + i, 4);
    }
    other.index_type = HGRID_INDEX_U16;
    other.positions = positions, other.position_stride = strides[0];
    other.indices = indices, other.index_stride = strides[1];
    if (mesh->masks != NULL)
        other.masks = masks, other.mask_stride = strides[2];
    return other;
}

static void check_config(table *t, const test_case *c, bool is_scattered)
{
    hgrid_config config = HGRID_CONFIG_INIT_ONE_LEVEL;
    const size_t config_bytes = offsetof(hgrid_config, tasks) - offsetof(hgrid_config, method);
    static hgrid_counters expected[GROUPS_AT_MOST][2], work[GROUPS_AT_MOST][2];
    memcpy(&config.method, next(t, config_bytes), config_bytes);
    config.quality = next_word(t);
    const size_t blob_bytes = next_word(t);
    memcpy(expected, next(t, c->group_count * sizeof *expected),
           c->group_count * sizeof *expected);
    const void *blob = next(t, blob_bytes);

    grid_view views[VIEWS];
    const hgrid_mesh mesh = is_scattered ? scattered(&c->mesh) : c->mesh;
    make_views(&mesh, &config, blob, blob_bytes, views);
    memset(work, 0, sizeof work);
    for (uint32_t g = 0; g < c->group_count; g++) {
        for (size_t ray = 0; ray < c->ray_count; ray++)
            check_ray(&views[g % VIEWS], c, &c->groups[g], ray, work[g]);
        check_batches(&views[(g + 1) % VIEWS], c, &c->groups[g]);
    }
    CHECK_ANSWER(memcmp(work, expected, c->group_count * sizeof *expected) == 0);
    check_points(&views[config.method % VIEWS], c);
}

static void check_case(table *t)
{
    static test_case c;
    const hgrid_mesh empty = HGRID_MESH_INIT;
    c.mesh = empty;
    c.mesh.vertex_count = next_word(t);
    c.mesh.triangle_count = next_word(t);
    const uint32_t mask_count = next_word(t);
    c.ray_count = next_word(t), c.group_count = next_word(t);
    c.point_count = next_word(t), c.config_count = next_word(t);
    CHECK(c.ray_count <= RAYS_AT_MOST && c.group_count <= GROUPS_AT_MOST);
    const size_t bytes[] = {12 * c.mesh.vertex_count, 12 * c.mesh.triangle_count, 4 * mask_count};
    c.mesh.positions = guarded_copy(next(t, bytes[0]), bytes[0]);
    c.mesh.indices = guarded_copy(next(t, bytes[1]), bytes[1]);
    if (mask_count > 0)
        c.mesh.masks = guarded_copy(next(t, bytes[2]), bytes[2]);
    c.rays = (const hgrid_ray *)next(t, c.ray_count * sizeof *c.rays);
    for (uint32_t i = 0; i < c.group_count; i++) {
        group *g = &c.groups[i];
        g->mask = next_word(t), g->cull = next_word(t);
        g->skip = next_word(t), g->rule = next_word(t);
        for (size_t ray = 0; ray < c.ray_count; ray++) {
            g->counts[ray] = next_word(t);
            g->offered[ray] = (const hgrid_hit *)next(t, g->counts[ray] * sizeof(hgrid_hit));
        }
    }
    c.points = (const point_question *)next(t, c.point_count * sizeof *c.points);
    for (uint32_t i = 0; i < c.config_count; i++)
        check_config(t, &c, i % 2 == 1);
}

static int check_table(int argc, char **argv)
{
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    CHECK(file != NULL && fseek(file, 0, SEEK_END) == 0);
    const size_t bytes = (size_t)ftell(file);
    unsigned char *all = (unsigned char *)malloc(bytes);
    CHECK(all != NULL && fseek(file, 0, SEEK_SET) == 0);
    CHECK(fread(all, 1, bytes, file) == bytes && fclose(file) == 0);
    table t = {all};
    for (uint32_t rest = next_word(&t); rest > 0; rest--)
        check_case(&t);
    CHECK(t.at == all + bytes);
    printf("%zu\n", answer_count);
    free(all);
    return 0;
}

#endif
