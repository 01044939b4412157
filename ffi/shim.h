/* What the bindings of Embree cannot give: callbacks, and errors as plain numbers.
 *
 * A monitor belongs to one device. It keeps the first error since the last
 * take, and counts the bytes the device holds. Any thread may call into Embree
 * meanwhile. The monitor must outlive the device: Embree calls it while the
 * device is torn down.
 */
#ifndef DUALIGHT_SHIM_H
#define DUALIGHT_SHIM_H

#include <stddef.h>
#include <stdint.h>

struct dualight_monitor;

/* A new monitor, NULL when out of memory. */
struct dualight_monitor *dualight_monitor_new(void);

/* Frees the monitor; after its device is gone. NULL is allowed. */
void dualight_monitor_free(struct dualight_monitor *monitor);

/* Opens a device watched by the monitor.
 *
 * Returns 0 and sets `*device` (an RTCDevice, to be released by
 * rtcReleaseDevice), or returns Embree's error code and sets it to NULL.
 */
int dualight_device_open(const char *config, struct dualight_monitor *monitor, void **device);

/* The error since the last take, 0 if none, and forgets it.
 *
 * Its message, cut to `capacity` bytes with the final zero (at least 1), goes
 * to `message`.
 */
int dualight_monitor_take_error(struct dualight_monitor *monitor, char *message, size_t capacity);

/* Bytes the device holds now and held at most. */
void dualight_monitor_memory(struct dualight_monitor *monitor, int64_t *current, int64_t *peak);

#endif
