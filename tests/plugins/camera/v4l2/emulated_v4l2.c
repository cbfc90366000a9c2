/* Video4Linux2 devices at the boundary of the C library, for tests on machines without a camera.
 *
 * Loaded with LD_PRELOAD. A path that ends in /dev/videoN can be opened if the file videoN stands in the folder
 * that the environment variable EMULATED_V4L2 names. That file describes the device; tests/support/emulated_v4l2.py
 * writes it.
 * Each call that changes the device is appended to the file videoN.log.
 *
 * The descriptor is a timer: readable when a frame is due, as a device is readable when a buffer is full.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define DEVICES 8
#define BUFFERS 8
#define MODES 32
#define CONTROLS 8
#define BUFFER_SIZE (1 << 21)
#define PADDING 64

struct mode { uint32_t code, width, height, fps; };
struct control { uint32_t id; int32_t minimum, maximum, step, value; };

struct device {
    int used, number, fd, streaming, queue[BUFFERS], queued, buffers, sequence;
    struct mode modes[MODES], now;
    int mode_count, control_count;
    struct control controls[CONTROLS];
    int metadata, busy, deny, delay_us;
    void *memory[BUFFERS];
};

static struct device devices[DEVICES];
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static const char *folder(void) { return getenv("EMULATED_V4L2"); }

static void *next(const char *name) { return dlsym(RTLD_NEXT, name); }

static void path_of(char *out, size_t size, int number, const char *suffix) {
    snprintf(out, size, "%s/video%d%s", folder(), number, suffix);
}

static int has_flag(int number, const char *suffix) {
    char path[512];
    path_of(path, sizeof path, number, suffix);
    return access(path, F_OK) == 0;
}

static void note(struct device *device, const char *format, ...) {
    char path[512];
    path_of(path, sizeof path, device->number, ".log");
    FILE *file = fopen(path, "a");
    if (!file) return;
    va_list arguments;
    va_start(arguments, format);
    vfprintf(file, format, arguments);
    va_end(arguments);
    fputc('\n', file);
    fclose(file);
}

static int load(struct device *device) {
    char path[512], line[256];
    path_of(path, sizeof path, device->number, "");
    FILE *file = fopen(path, "r");
    if (!file) return 0;
    while (fgets(line, sizeof line, file)) {
        char code[5] = "    ";
        struct mode mode;
        struct control control;
        if (sscanf(line, "mode %4c %u %u %u", code, &mode.width, &mode.height, &mode.fps) == 4) {
            mode.code = v4l2_fourcc(code[0], code[1], code[2], code[3]);
            if (device->mode_count < MODES) device->modes[device->mode_count++] = mode;
        } else if (sscanf(line, "control %u %d %d %d %d", &control.id, &control.minimum, &control.maximum,
                          &control.step, &control.value) == 5) {
            if (device->control_count < CONTROLS) device->controls[device->control_count++] = control;
        } else if (sscanf(line, "delay_us %d", &device->delay_us) != 1) {
            device->metadata |= !strncmp(line, "metadata", 8);
            device->busy |= !strncmp(line, "busy", 4);
            device->deny |= !strncmp(line, "deny", 4);
        }
    }
    fclose(file);
    device->now = device->modes[0];
    return 1;
}

static int open_device(int number) {
    pthread_mutex_lock(&lock);
    struct device *device = NULL;
    for (int index = 0; index < DEVICES && !device; index++)
        if (!devices[index].used) device = &devices[index];
    int fd = -1;
    if (device) {
        memset(device, 0, sizeof *device);
        device->number = number;
        if (!load(device) || has_flag(number, ".unplugged")) errno = ENOENT;
        else if (device->deny) errno = EACCES;
        else if ((fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)) >= 0) {
            device->used = 1;
            device->fd = fd;
        }
    } else errno = EMFILE;
    pthread_mutex_unlock(&lock);
    return fd;
}

static int number_of(const char *path) {
    int number, end = 0;
    const char *name = path ? strstr(path, "/dev/video") : NULL;
    if (!folder() || !name || sscanf(name, "/dev/video%d%n", &number, &end) != 1 || name[end]) return -1;
    return number;
}

static struct device *find(int fd) {
    for (int index = 0; index < DEVICES; index++)
        if (devices[index].used && devices[index].fd == fd) return &devices[index];
    return NULL;
}

#define OPEN(name)                                                                          \
    int name(const char *path, int flags, ...) {                                            \
        mode_t mode = 0;                                                                    \
        if (flags & (O_CREAT | O_TMPFILE)) {                                                \
            va_list arguments;                                                              \
            va_start(arguments, flags);                                                     \
            mode = va_arg(arguments, mode_t);                                               \
            va_end(arguments);                                                              \
        }                                                                                   \
        int number = number_of(path);                                                       \
        if (number >= 0) return open_device(number);                                        \
        return ((int (*)(const char *, int, mode_t))next(#name))(path, flags, mode);        \
    }
OPEN(open)
OPEN(open64)

int close(int fd) {
    pthread_mutex_lock(&lock);
    struct device *device = find(fd);
    if (device) {
        for (int index = 0; index < BUFFERS; index++)
            if (device->memory[index]) munmap(device->memory[index], BUFFER_SIZE);
        device->used = 0;
    }
    pthread_mutex_unlock(&lock);
    return ((int (*)(int))next("close"))(fd);
}

ssize_t readlink(const char *path, char *out, size_t size) {
    int fd;
    if (folder() && sscanf(path, "/proc/self/fd/%d", &fd) == 1) {
        pthread_mutex_lock(&lock);
        struct device *device = find(fd);
        char text[32];
        int length = device ? snprintf(text, sizeof text, "/dev/video%d", device->number) : 0;
        pthread_mutex_unlock(&lock);
        if (length && (size_t)length <= size) {
            memcpy(out, text, length);
            return length;
        }
    }
    return ((ssize_t(*)(const char *, char *, size_t))next("readlink"))(path, out, size);
}

static void *map(int fd, off_t offset) {
    struct device *device = find(fd);
    int index = offset / BUFFER_SIZE;
    if (!device || index >= BUFFERS) return NULL;
    void *(*real)(void *, size_t, int, int, int, off_t) = next("mmap");
    void *memory = real(NULL, BUFFER_SIZE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return device->memory[index] = memory;
}

#define MMAP(name)                                                                             \
    void *name(void *address, size_t length, int protection, int flags, int fd, off_t offset) { \
        if (fd >= 0 && folder()) {                                                              \
            pthread_mutex_lock(&lock);                                                          \
            void *memory = map(fd, offset);                                                     \
            pthread_mutex_unlock(&lock);                                                        \
            if (memory) return memory;                                                          \
        }                                                                                       \
        return ((void *(*)(void *, size_t, int, int, int, off_t))next(#name))(                  \
            address, length, protection, flags, fd, offset);                                    \
    }
MMAP(mmap)
MMAP(mmap64)

static int fail(int code) {
    errno = code;
    return -1;
}

static void tick(struct device *device, long nanoseconds) {
    struct itimerspec times = {{0, nanoseconds}, {0, nanoseconds}};
    timerfd_settime(device->fd, 0, &times, NULL);
}

static void choose(struct device *device, uint32_t code, uint32_t width, uint32_t height) {
    struct mode *best = NULL;
    for (int pass = 0; pass < 2 && !best; pass++) { /* a format that it does not have: the first one */
        long distance = -1;
        for (int index = 0; index < device->mode_count; index++) {
            struct mode *mode = &device->modes[index];
            if (mode->code != (pass ? device->modes[0].code : code)) continue;
            long far = labs((long)mode->width - width) + labs((long)mode->height - height);
            if (distance < 0 || far < distance) {
                distance = far;
                best = mode;
            }
        }
    }
    device->now = *best;
}

static void fill_format(struct device *device, struct v4l2_format *format) {
    format->fmt.pix.width = device->now.width;
    format->fmt.pix.height = device->now.height;
    format->fmt.pix.pixelformat = device->now.code;
    format->fmt.pix.field = V4L2_FIELD_NONE;
    format->fmt.pix.bytesperline = 0;
    format->fmt.pix.sizeimage = BUFFER_SIZE;
}

static uint32_t fill_frame(struct device *device, unsigned char *memory) {
    if (device->now.code != V4L2_PIX_FMT_MJPEG) { /* YUYV: a grey that changes with each frame */
        uint32_t size = device->now.width * device->now.height * 2;
        for (uint32_t index = 0; index < size; index += 2) {
            memory[index] = 16 + device->sequence % 200;
            memory[index + 1] = 128;
        }
        return size;
    }
    char path[512];
    path_of(path, sizeof path, device->number, ".jpg");
    FILE *file = fopen(path, "rb");
    if (!file) return 0;
    size_t size = fread(memory, 1, BUFFER_SIZE - PADDING, file);
    fclose(file);
    memset(memory + size, 0, PADDING);
    return size + PADDING;
}

static int dequeue(struct device *device, struct v4l2_buffer *buffer) {
    uint64_t ticks;
    if (has_flag(device->number, ".unplugged")) return fail(ENODEV);
    if (!device->streaming) return fail(EINVAL);
    if (read(device->fd, &ticks, sizeof ticks) < 0) return fail(EAGAIN);
    if (has_flag(device->number, ".stalled")) {
        tick(device, 0); /* no buffer becomes full any more */
        return fail(EAGAIN);
    }
    if (!device->queued) return fail(EAGAIN);
    int index = device->queue[0];
    memmove(device->queue, device->queue + 1, --device->queued * sizeof(int));
    buffer->index = index;
    buffer->bytesused = fill_frame(device, device->memory[index]);
    buffer->length = BUFFER_SIZE;
    buffer->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    buffer->sequence = device->sequence++;
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    int64_t at_us = now.tv_sec * 1000000LL + now.tv_nsec / 1000 - device->delay_us;
    buffer->timestamp.tv_sec = at_us / 1000000;
    buffer->timestamp.tv_usec = at_us % 1000000;
    return 0;
}

static struct control *control(struct device *device, uint32_t id) {
    for (int index = 0; index < device->control_count; index++)
        if (device->controls[index].id == id) return &device->controls[index];
    return NULL;
}

static int set_control(struct device *device, uint32_t id, int32_t value) {
    struct control *entry = control(device, id), *automatic = control(device, V4L2_CID_EXPOSURE_AUTO);
    if (!entry) return fail(EINVAL);
    if (id == V4L2_CID_EXPOSURE_ABSOLUTE && automatic && automatic->value != V4L2_EXPOSURE_MANUAL)
        return fail(EACCES);
    value = value < entry->minimum ? entry->minimum : value > entry->maximum ? entry->maximum : value;
    entry->value = value - (value - entry->minimum) % entry->step;
    note(device, "control %u %d", id, entry->value);
    return 0;
}

static int enumerate(struct device *device, unsigned long request, void *argument) {
    int found = -1;
    if (request == VIDIOC_ENUM_FMT) {
        struct v4l2_fmtdesc *format = argument;
        for (int index = 0; index < device->mode_count; index++) {
            if (index && device->modes[index].code == device->modes[index - 1].code) continue;
            if (++found != (int)format->index) continue;
            format->pixelformat = device->modes[index].code;
            snprintf((char *)format->description, 32, "%s",
                     format->pixelformat == V4L2_PIX_FMT_MJPEG ? "Motion-JPEG" : "YUYV 4:2:2");
            return 0;
        }
    } else if (request == VIDIOC_ENUM_FRAMESIZES) {
        struct v4l2_frmsizeenum *size = argument;
        for (int index = 0; index < device->mode_count; index++) {
            struct mode *mode = &device->modes[index], *before = index ? mode - 1 : NULL;
            if (mode->code != size->pixel_format) continue;
            if (before && before->code == mode->code && before->width == mode->width &&
                before->height == mode->height)
                continue;
            if (++found != (int)size->index) continue;
            size->type = V4L2_FRMSIZE_TYPE_DISCRETE;
            size->discrete.width = mode->width;
            size->discrete.height = mode->height;
            return 0;
        }
    } else {
        struct v4l2_frmivalenum *interval = argument;
        for (int index = 0; index < device->mode_count; index++) {
            struct mode *mode = &device->modes[index];
            if (mode->code != interval->pixel_format || mode->width != interval->width ||
                mode->height != interval->height || ++found != (int)interval->index)
                continue;
            interval->type = V4L2_FRMIVAL_TYPE_DISCRETE;
            interval->discrete.numerator = 1;
            interval->discrete.denominator = mode->fps;
            return 0;
        }
    }
    return fail(EINVAL);
}

static int call(struct device *device, unsigned long request, void *argument) {
    switch (request) {
    case VIDIOC_QUERYCAP: {
        struct v4l2_capability *capability = argument;
        memset(capability, 0, sizeof *capability);
        strcpy((char *)capability->driver, "uvcvideo");
        snprintf((char *)capability->card, 32, "Emulated Camera %d", device->number);
        snprintf((char *)capability->bus_info, 32, "usb-0000:00:14.0-%d", device->number);
        capability->device_caps =
            (device->metadata ? V4L2_CAP_META_CAPTURE : V4L2_CAP_VIDEO_CAPTURE) | V4L2_CAP_STREAMING;
        capability->capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING | V4L2_CAP_DEVICE_CAPS;
        return 0;
    }
    case VIDIOC_ENUM_FMT:
    case VIDIOC_ENUM_FRAMESIZES:
    case VIDIOC_ENUM_FRAMEINTERVALS:
        return enumerate(device, request, argument);
    case VIDIOC_G_FMT:
        fill_format(device, argument);
        return 0;
    case VIDIOC_S_FMT: {
        struct v4l2_format *format = argument;
        if (device->busy) return fail(EBUSY);
        choose(device, format->fmt.pix.pixelformat, format->fmt.pix.width, format->fmt.pix.height);
        fill_format(device, format);
        note(device, "format %.4s %u %u", (char *)&device->now.code, device->now.width, device->now.height);
        return 0;
    }
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
        struct v4l2_streamparm *parameters = argument;
        struct v4l2_fract *interval = &parameters->parm.capture.timeperframe;
        if (request == VIDIOC_S_PARM && interval->denominator) {
            uint32_t asked = interval->denominator / (interval->numerator ? interval->numerator : 1);
            for (int index = 0; index < device->mode_count; index++) {
                struct mode *mode = &device->modes[index];
                if (mode->code == device->now.code && mode->width == device->now.width &&
                    mode->height == device->now.height && mode->fps == asked)
                    device->now = *mode;
            }
            note(device, "rate %u", device->now.fps);
        }
        parameters->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
        interval->numerator = 1;
        interval->denominator = device->now.fps;
        return 0;
    }
    case VIDIOC_REQBUFS: {
        struct v4l2_requestbuffers *buffers = argument;
        if (device->busy) return fail(EBUSY);
        if (buffers->count > BUFFERS) buffers->count = BUFFERS;
        device->buffers = buffers->count;
        device->queued = 0;
        return 0;
    }
    case VIDIOC_QUERYBUF: {
        struct v4l2_buffer *buffer = argument;
        if ((int)buffer->index >= device->buffers) return fail(EINVAL);
        buffer->length = BUFFER_SIZE;
        buffer->m.offset = buffer->index * BUFFER_SIZE;
        return 0;
    }
    case VIDIOC_QBUF: {
        struct v4l2_buffer *buffer = argument;
        if ((int)buffer->index >= device->buffers || device->queued >= BUFFERS) return fail(EINVAL);
        device->queue[device->queued++] = buffer->index;
        return 0;
    }
    case VIDIOC_DQBUF:
        return dequeue(device, argument);
    case VIDIOC_STREAMON:
        if (device->busy) return fail(EBUSY);
        device->streaming = 1;
        tick(device, 1000000000L / device->now.fps);
        note(device, "stream on");
        return 0;
    case VIDIOC_STREAMOFF:
        device->streaming = device->queued = 0;
        tick(device, 1); /* whoever waits is woken, and finds no stream */
        note(device, "stream off");
        return 0;
    case VIDIOC_QUERYCTRL: {
        struct v4l2_queryctrl *query = argument;
        struct control *entry = control(device, query->id);
        if (!entry) return fail(EINVAL);
        query->minimum = entry->minimum;
        query->maximum = entry->maximum;
        query->step = entry->step;
        query->default_value = entry->value;
        query->flags = 0;
        return 0;
    }
    case VIDIOC_G_CTRL: {
        struct v4l2_control *value = argument;
        struct control *entry = control(device, value->id);
        if (!entry) return fail(EINVAL);
        value->value = entry->value;
        return 0;
    }
    case VIDIOC_S_CTRL: {
        struct v4l2_control *value = argument;
        return set_control(device, value->id, value->value);
    }
    default:
        return fail(ENOTTY);
    }
}

int ioctl(int fd, unsigned long request, ...) {
    va_list arguments;
    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    pthread_mutex_lock(&lock);
    struct device *device = find(fd);
    int result = device ? call(device, (uint32_t)request, argument) : 0, code = errno;
    pthread_mutex_unlock(&lock);
    if (!device) return ((int (*)(int, unsigned long, void *))next("ioctl"))(fd, request, argument);
    errno = code;
    return result;
}
