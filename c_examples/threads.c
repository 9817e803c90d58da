#include "threads.h"

#include <pthread.h>
#include <stdbool.h>

typedef struct {
    pthread_t thread;
    bool has_thread;
    hgrid_task task;
    void *task_context;
    uint32_t index;
} one_task;

static void *run_one(void *argument)
{
    const one_task *one = (const one_task *)argument;
    one->task(one->task_context, one->index);
    return NULL;
}

void run_on_threads(void *context, uint32_t count, hgrid_task task, void *task_context)
{
    (void)context;
    one_task all[MAX_THREADS];
    /* The last task runs here, and so does every task for which no thread starts. */
    for (uint32_t i = 0; i < count; i++) {
        all[i].task = task, all[i].task_context = task_context, all[i].index = i;
        all[i].has_thread =
            i + 1 < count && pthread_create(&all[i].thread, NULL, run_one, &all[i]) == 0;
        if (!all[i].has_thread)
            run_one(&all[i]);
    }
    for (uint32_t i = 0; i < count; i++)
        if (all[i].has_thread)
            pthread_join(all[i].thread, NULL);
}
