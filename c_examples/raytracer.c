/*
 * A ray tracer for triangle meshes: shadows, ambient occlusion, threads, and pictures of each pixel's cost.
 *
 *     raytracer                          the built-in scene, to raytracer.ppm
 *     raytracer bunny.ply -o bunny.ppm   a mesh of yours
 *     raytracer --help                   all the rest
 *
 * Functions to read: build_grid in grid.c (sizes, memory, build), and render.c (all queries of a tile in one
 * call, and tiles on threads). light.c does not use hgrid. Camera and light are those of the project's own
 * renderer in lab/: without shadows and occlusion the two draw the same picture, byte for byte.
 *
 * Output: `sizes` is the time of hgrid_sizes and of malloc, `build` is that of hgrid_build alone, `time to
 * image` is the time from the mesh to the last pixel.
 */

#include "camera.h"
#include "grid.h"
#include "heat.h"
#include "memory.h"
#include "options.h"
#include "picture.h"
#include "progress.h"
#include "render.h"
#include "scene.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const program_name = "raytracer";

static hgrid_config config_of(const options *o)
{
    hgrid_config config = METHODS[o->method].config;
    if (o->density > 0)
        config.density = o->density;
    return config;
}

static void print(const options *o, const scene *s, const hgrid_config *config, const built_grid *b,
                  size_t hits, double render_seconds)
{
    printf("scene          %s\n", o->input != NULL ? o->input : "knot, built in");
    printf("triangles      %lu\n", (unsigned long)s->triangle_count);
    printf("skipped        %lu\n", (unsigned long)b->report.skipped_count);
    printf("method         %s\n", METHODS[o->method].name);
    if (config->method != HGRID_METHOD_BVH)
        printf("density        %g\n", (double)b->report.density);
    printf("index bytes    %lu\n", (unsigned long)b->report.index_bytes);
    printf("scratch bytes  %lu\n", (unsigned long)b->scratch_bytes);
    printf("threads        %d\n", o->threads);
    printf("hits           %lu of %lu rays\n", (unsigned long)hits,
           (unsigned long)o->size * (unsigned long)o->size);
    printf("sizes          %.3f s\n", b->sizes_seconds);
    printf("build          %.3f s\n", b->build_seconds);
    printf("render         %.3f s\n", render_seconds);
    printf("time to image  %.3f s\n", b->sizes_seconds + b->build_seconds + render_seconds);
    printf("wrote %s\n", o->output);
}

int main(int count, char **words)
{
    const options o = parse_options(count, words);
    scene s = load_scene(o.input);
    FILE *output = open_picture(o.output);
    const size_t pixel_count = (size_t)o.size * (size_t)o.size;

    const hgrid_mesh mesh = mesh_of(&s);
    const hgrid_config config = config_of(&o);
    progress p = start_progress("build", o.has_progress);
    built_grid b = build_grid(&mesh, &config, (uint32_t)o.threads, &p);

    const camera c = frame(&s);
    p = start_progress("render", o.has_progress);
    picture_job job;
    memset(&job, 0, sizeof job);
    job.grid = &b.grid, job.camera = &c;
    job.size = job.row_count = o.size;
    job.has_shadows = o.has_shadows, job.sky_rays = o.sky_rays;
    job.pixels = (unsigned char *)allocate(pixel_count, 3);
    uint32_t *work = NULL;
    if (o.heat != NO_HEAT)
        work = (uint32_t *)allocate(pixel_count, sizeof *work);
    *(o.heat == HEAT_TESTS ? &job.tests : &job.steps) = work;
    job.threads = (uint32_t)o.threads, job.progress = &p;

    const double start = now();
    const size_t hits = render(&job);
    const double render_seconds = now() - start;

    if (work != NULL)
        write_heat(output, o.output, o.size, work, o.heat == HEAT_TESTS ? "TESTS" : "STEPS");
    else
        write_picture(output, o.output, o.size, o.size, job.pixels);
    print(&o, &s, &config, &b, hits, render_seconds);

    free(work);
    free(job.pixels);
    free(b.index.allocation);
    free(s.positions);
    free(s.indices);
    return 0;
}
