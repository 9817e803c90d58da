/* Structs of earlier and later versions: smaller ones are refused, larger ones are accepted if the rest is
 * zero, and not a byte outside struct_size is read or written. */
#ifndef VERSIONS_H
#define VERSIONS_H

#include "check.h"

/* The largest struct_size that the library accepts. */
#define MOST ((size_t)4096)

/* The bytes after the known fields. */
typedef enum { ZEROS, FIRST_IS_ONE, LAST_IS_ONE } tail;

/* A struct_size, and whether a struct of that size with that tail is accepted. */
typedef struct {
    size_t size;
    tail rest;
    bool is_accepted;
} version;

static inline version version_of(int i, size_t known)
{
    const version all[] = {
        {known, ZEROS, true},
        {known + 8, ZEROS, true},
        {known + 1, ZEROS, true},
        {MOST, ZEROS, true},
        {0, ZEROS, false},
        {1, ZEROS, false},
        {known - 1, ZEROS, false},
        {known - 8, ZEROS, false},
        {known + 8, FIRST_IS_ONE, false},
        {known + 8, LAST_IS_ONE, false},
        {known + 1, LAST_IS_ONE, false},
        {MOST, LAST_IS_ONE, false},
        {MOST + 1, ZEROS, false},
        {INT32_MAX, ZEROS, false},
        {UINT32_MAX, ZEROS, false},
    };
    return all[i];
}

enum { VERSIONS = 15 };

/* Memory that ends where a struct of that version does, if its size is acceptable, or else where the known
 * bytes end; and its contents before the call. */
static unsigned char *page, before[MOST];

static inline void *place(const void *usual, size_t known, version v)
{
    if (page == NULL)
        page = (unsigned char *)guarded(MOST);
    const bool is_there = v.size >= known && v.size <= MOST;
    /* The end of a struct is aligned like its start, except for odd sizes. */
    const size_t size = is_there ? (v.size + 7) / 8 * 8 : known;
    unsigned char *start = page + MOST - size;
    memset(page, 0xc7, MOST);
    memcpy(start, usual, known);
    const uint32_t struct_size = (uint32_t)v.size;
    memcpy(start, &struct_size, sizeof struct_size);
    if (is_there) {
        memset(start + known, 0, v.size - known);
        if (v.rest == FIRST_IS_ONE)
            start[known] = 1;
        if (v.rest == LAST_IS_ONE)
            start[v.size - 1] = 1;
    }
    memcpy(before, page, MOST);
    return start;
}

/* Checks that a refused struct is unchanged, and that an accepted one keeps its size and the bytes after the
 * known ones. */
static inline void check_after(const void *place, size_t known, version v)
{
    const size_t start = (size_t)((const unsigned char *)place - page);
    CHECK(memcmp(page, before, v.is_accepted ? start + sizeof(uint32_t) : MOST) == 0);
    CHECK(memcmp(page + start + known, before + start + known, MOST - start - known) == 0);
}

/* Makes a call with `it`, a struct of each version. */
#define CHECK_VERSIONS(parameter, type, usual, call) \
    do { \
        const type known_ = (usual); \
        for (int i_ = 0; i_ < VERSIONS; i_++) { \
            const version v_ = version_of(i_, sizeof known_); \
            type *it = (type *)place(&known_, sizeof known_, v_); \
            EXPECT(v_.is_accepted ? HGRID_OK : HGRID_ERROR_STRUCT_SIZE, call); \
            check_after(it, sizeof known_, v_); \
        } \
        puts("sized " #parameter); \
    } while (0)

#endif
