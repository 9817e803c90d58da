/* A loop over threads. */
#ifndef THREADS_H
#define THREADS_H

#include <hgrid.h>

enum { MAX_THREADS = 256 };

/* Calls task(task_context, 0) to task(task_context, count - 1), each on its own thread, and returns
 * when all have returned. At most MAX_THREADS.
 *
 * hgrid takes a function of this type for builds on threads, because it starts none itself. A program
 * with a pool of threads would pass one that uses the pool. */
void run_on_threads(void *context, uint32_t count, hgrid_task task, void *task_context);

#endif
