/*
 * The built-in scene: a closed, finely bumped tube along a trefoil, half a million triangles.
 *
 * It is lab/src/scene/knot.rs and noise.rs, line by line. It uses only IEEE + - * / and square roots in
 * double, rounded to float once, so both make the same bits; a test compares them.
 */

#include "memory.h"
#include "scene.h"

#include <math.h>

/* Rows along the curve, columns around the tube; both are cyclic. */
enum { ROWS = 2000, COLUMNS = 125 };

/* The torus, the distance of the curve from the torus' core, and the tube around the curve. */
static const double TORUS_RADIUS = 1, STRAND_RADIUS = 0.45, TUBE_RADIUS = 0.26;

/* The frequency and the height of the coarsest bumps, the number of octaves, and the height of each as a part
 * of the one before. */
static const double BUMP_FREQUENCY = 3, BUMP_HEIGHT = 0.08, BUMP_GAIN = 0.45;
enum { BUMP_OCTAVES = 6 };

/* A point of the curve and the frame of the tube there. */
typedef struct {
    double centre[3], normal[3], binormal[3];
} station;

/* Mixes bits: every bit of the result depends on every bit of z. */
static uint64_t mix(uint64_t z)
{
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

/* Returns the value at a lattice point, -1 to 1. */
static double value(uint64_t x, uint64_t y, uint64_t z)
{
    const uint64_t key = x * UINT64_C(0x9e3779b97f4a7c15) + y * UINT64_C(0xc2b2ae3d27d4eb4f) +
                         z * UINT64_C(0x165667b19e3779f9);
    return 2 * ((double)(mix(key) >> 11) / 9007199254740992.0) - 1;
}

static double lerp(double from, double to, double t)
{
    return from + (to - from) * t;
}

/* Returns noise: random values at the points of the integer lattice, smooth in between; -1 to 1. */
static double noise(const double point[3])
{
    uint64_t cell[3];
    double f[3];
    for (int axis = 0; axis < 3; axis++) {
        const double whole = floor(point[axis]), t = point[axis] - whole;
        cell[axis] = (uint64_t)(int64_t)whole;
        f[axis] = t * t * (3 - 2 * t);
    }
    double rows[4];
    for (uint64_t i = 0; i < 4; i++) {
        const uint64_t y = cell[1] + i % 2, z = cell[2] + i / 2;
        rows[i] = lerp(value(cell[0], y, z), value(cell[0] + 1, y, z), f[0]);
    }
    return lerp(lerp(rows[0], rows[1], f[1]), lerp(rows[2], rows[3], f[1]), f[2]);
}

/* Returns the height of the bumps at a point of the smooth tube. */
static double bumps(const double point[3])
{
    double sum = 0, frequency = BUMP_FREQUENCY, height = BUMP_HEIGHT;
    for (int octave = 0; octave < BUMP_OCTAVES; octave++) {
        const double scaled[3] = {point[0] * frequency, point[1] * frequency,
                                  point[2] * frequency};
        sum += height * noise(scaled);
        frequency *= 2;
        height *= BUMP_GAIN;
    }
    return sum;
}

/* Returns point i of n on the unit circle, almost equally spaced: cosine and sine. In each quadrant a
 * polynomial approximates the tangent of half the angle. */
static void circle(uint32_t i, uint32_t n, double point[2])
{
    const uint32_t quadrant = 4 * i / n;
    const double f = (double)(4 * i - quadrant * n) / n;
    const double f2 = f * f;
    const double t = f * (0.785 + f2 * (0.144 + f2 * 0.071));
    const double t2 = t * t;
    const double cosine = (1 - t2) / (1 + t2), sine = 2 * t / (1 + t2);
    point[0] = quadrant == 0 ? cosine : quadrant == 1 ? -sine : quadrant == 2 ? -cosine : sine;
    point[1] = quadrant == 0 ? sine : quadrant == 1 ? cosine : quadrant == 2 ? -sine : -cosine;
}

/* Adds two angles, each given as cosine and sine. */
static void turn(const double a[2], const double b[2], double sum[2])
{
    const double cosine = a[0] * b[0] - a[1] * b[1], sine = a[0] * b[1] + a[1] * b[0];
    sum[0] = cosine;
    sum[1] = sine;
}

/* Returns the station at an angle that goes once around while the curve closes. */
static station station_at(const double angle[2])
{
    double two[2], three[2];
    turn(angle, angle, two);
    turn(two, angle, three);
    const double cos2 = two[0], sin2 = two[1], cos3 = three[0], sin3 = three[1];
    const double reach = TORUS_RADIUS + STRAND_RADIUS * cos3;
    const double n[3] = {cos3 * cos2, cos3 * sin2, sin3};
    const double t[3] = {
        -2 * reach * sin2 - 3 * STRAND_RADIUS * sin3 * cos2,
        2 * reach * cos2 - 3 * STRAND_RADIUS * sin3 * sin2,
        3 * STRAND_RADIUS * cos3,
    };
    const double length = sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
    const station result = {
        {reach * cos2, reach * sin2, STRAND_RADIUS * sin3},
        {n[0], n[1], n[2]},
        {(t[1] * n[2] - t[2] * n[1]) / length, (t[2] * n[0] - t[0] * n[2]) / length,
         (t[0] * n[1] - t[1] * n[0]) / length},
    };
    return result;
}

/* Computes the point of the surface at an angle around the tube. */
static void surface(const station *s, const double angle[2], float point[3])
{
    double outward[3], smooth[3];
    for (int axis = 0; axis < 3; axis++) {
        outward[axis] = angle[0] * s->normal[axis] + angle[1] * s->binormal[axis];
        smooth[axis] = s->centre[axis] + TUBE_RADIUS * outward[axis];
    }
    const double height = bumps(smooth);
    for (int axis = 0; axis < 3; axis++)
        point[axis] = (float)(smooth[axis] + height * outward[axis]);
}

scene make_knot(void)
{
    scene s;
    s.vertex_count = (size_t)ROWS * COLUMNS;
    s.triangle_count = 2 * s.vertex_count;
    s.positions = (float(*)[3])allocate(s.vertex_count, sizeof *s.positions);
    s.indices = (uint32_t(*)[3])allocate(s.triangle_count, sizeof *s.indices);

    for (uint32_t row = 0; row < ROWS; row++) {
        double angle[2];
        circle(row, ROWS, angle);
        const station here = station_at(angle);
        for (uint32_t column = 0; column < COLUMNS; column++) {
            const uint32_t i = row * COLUMNS + column;
            circle(column, COLUMNS, angle);
            surface(&here, angle, s.positions[i]);

            /* Two triangles between this row and the next, this column and the next. */
            const uint32_t next_row = (row + 1) % ROWS * COLUMNS;
            const uint32_t next_column = (column + 1) % COLUMNS;
            const uint32_t b = row * COLUMNS + next_column, c = next_row + next_column;
            uint32_t(*t)[3] = s.indices + 2 * i;
            t[0][0] = i, t[0][1] = b, t[0][2] = c;
            t[1][0] = i, t[1][1] = c, t[1][2] = next_row + column;
        }
    }
    return s;
}
