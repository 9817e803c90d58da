/* A loop over threads. */
#ifndef THREADS_H
#define THREADS_H

#include <hgrid.h>

enum { MAX_THREADS = 256 };

/* Calls task(task_context, 0) to task(task_context, count - 1), each on a thread of its own, and
 * returns when all have returned. At most MAX_THREADS.
 *
 * This is also what hgrid wants to build on threads: hgrid itself starts none. A program that has a
 * pool of threads would use that. */
void run_on_threads(void *context, uint32_t count, hgrid_task task, void *task_context);

#endif
