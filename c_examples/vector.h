/* Vectors in double precision. */
#ifndef VECTOR_H
#define VECTOR_H

#include <math.h>

typedef struct {
    double x, y, z;
} vector;

static inline vector vector_of(const float v[3])
{
    const vector result = {v[0], v[1], v[2]};
    return result;
}

static inline void round_to(float to[3], vector v)
{
    to[0] = (float)v.x, to[1] = (float)v.y, to[2] = (float)v.z;
}

static inline double dot(vector a, vector b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline vector cross(vector a, vector b)
{
    const vector v = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return v;
}

static inline vector scale(vector v, double amount)
{
    const vector result = {v.x * amount, v.y * amount, v.z * amount};
    return result;
}

/* Returns from + amount * along. */
static inline vector offset(vector from, double amount, vector along)
{
    const vector v = {from.x + amount * along.x, from.y + amount * along.y,
                      from.z + amount * along.z};
    return v;
}

/* Returns the vector at length 1, or another one if it has no length. */
static inline vector unit(vector v, vector otherwise)
{
    const double length = sqrt(dot(v, v));
    const vector result = {v.x / length, v.y / length, v.z / length};
    return length > 0 ? result : otherwise;
}

static inline double larger(double a, double b)
{
    return a > b ? a : b;
}

#endif
