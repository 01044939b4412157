/* See shim.h. */
#include "shim.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>

/* Embree's own declarations, in the part used here. Its headers need not be
 * installed, and these functions are the same in every Embree 4. Error codes
 * are a C enum there: an int here, since a newer Embree may know more of them.
 */
typedef struct RTCDeviceTy *RTCDevice;
extern RTCDevice rtcNewDevice(const char *config);
extern int rtcGetDeviceError(RTCDevice device);
typedef void (*error_function)(void *pointer, int code, const char *text);
extern void rtcSetDeviceErrorFunction(RTCDevice device, error_function, void *pointer);
typedef bool (*memory_function)(void *pointer, ssize_t bytes, bool post);
extern void rtcSetDeviceMemoryMonitorFunction(RTCDevice device, memory_function, void *pointer);

enum { RTC_ERROR_NONE = 0, RTC_ERROR_UNKNOWN = 1, MESSAGE_SIZE = 512 };

struct dualight_monitor {
    /* Error and message go together, so a lock guards them. */
    pthread_mutex_t lock;
    int error;
    char message[MESSAGE_SIZE];
    /* Worker threads report memory while a scene is built. */
    _Atomic int64_t current;
    _Atomic int64_t peak;
};

/* Copies as much of the text as there is room for; always ends it. */
static void copy_text(char *to, size_t capacity, const char *from)
{
    size_t length = strlen(from);
    if (length >= capacity)
        length = capacity - 1;
    memcpy(to, from, length);
    to[length] = '\0';
}

static void on_error(void *pointer, int code, const char *text)
{
    struct dualight_monitor *monitor = pointer;
    pthread_mutex_lock(&monitor->lock);
    /* The first error is the cause, later ones may be its consequences. */
    if (monitor->error == RTC_ERROR_NONE) {
        monitor->error = code;
        copy_text(monitor->message, MESSAGE_SIZE, text ? text : "");
    }
    pthread_mutex_unlock(&monitor->lock);
}

static bool on_memory(void *pointer, ssize_t bytes, bool post)
{
    struct dualight_monitor *monitor = pointer;
    (void)post; /* said before allocating or after freeing: counted all the same */
    int64_t now = atomic_fetch_add(&monitor->current, (int64_t)bytes) + (int64_t)bytes;
    int64_t peak = atomic_load(&monitor->peak);
    while (now > peak && !atomic_compare_exchange_weak(&monitor->peak, &peak, now))
        ;
    return true; /* false would cancel the build */
}

struct dualight_monitor *dualight_monitor_new(void)
{
    struct dualight_monitor *monitor = calloc(1, sizeof *monitor);
    if (monitor && pthread_mutex_init(&monitor->lock, NULL) != 0) {
        free(monitor);
        monitor = NULL;
    }
    return monitor;
}

void dualight_monitor_free(struct dualight_monitor *monitor)
{
    if (!monitor)
        return;
    pthread_mutex_destroy(&monitor->lock);
    free(monitor);
}

int dualight_device_open(const char *config, struct dualight_monitor *monitor, void **device)
{
    RTCDevice opened = rtcNewDevice(config);
    *device = opened;
    if (!opened) {
        int error = rtcGetDeviceError(NULL);
        return error != RTC_ERROR_NONE ? error : RTC_ERROR_UNKNOWN;
    }
    rtcSetDeviceErrorFunction(opened, on_error, monitor);
    rtcSetDeviceMemoryMonitorFunction(opened, on_memory, monitor);
    return RTC_ERROR_NONE;
}

int dualight_monitor_take_error(struct dualight_monitor *monitor, char *message, size_t capacity)
{
    pthread_mutex_lock(&monitor->lock);
    int error = monitor->error;
    copy_text(message, capacity, monitor->message);
    monitor->error = RTC_ERROR_NONE;
    monitor->message[0] = '\0';
    pthread_mutex_unlock(&monitor->lock);
    return error;
}

void dualight_monitor_memory(struct dualight_monitor *monitor, int64_t *current, int64_t *peak)
{
    *current = atomic_load(&monitor->current);
    *peak = atomic_load(&monitor->peak);
}
