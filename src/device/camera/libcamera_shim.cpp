/* One camera of libcamera: opening it, the queue of pictures, and closing it in whatever state it is. */
#include "device/camera/libcamera_shim.h"

#include <libcamera/framebuffer_allocator.h>
#include <libcamera/request.h>
#include <libcamera/stream.h>
#include <linux/dma-buf.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>

#include "device/camera/libcamera_formats.h"
#include "device/camera/libcamera_shared.hpp"

namespace {

using clt::Failure;
using libcamera::Camera;
using libcamera::ControlList;
using libcamera::FrameBuffer;
using libcamera::Request;

/* One picture is with the caller, one waits for it, the others are being filled. */
constexpr unsigned BUFFERS = 4;
constexpr size_t READY_MOST = 1;

/* A buffer's memory, mapped for reading. */
class Mapping {
public:
  Mapping(int descriptor, size_t size) : descriptor_(descriptor), size_(size) {
    start_ = mmap(nullptr, size, PROT_READ, MAP_SHARED, descriptor, 0);
    if (start_ == MAP_FAILED) {
      throw Failure{CLT_FAILED, std::string("a picture's buffer cannot be mapped: ") + strerror(errno)};
    }
  }
  ~Mapping() {
    munmap(start_, size_);
  }
  Mapping(const Mapping &) = delete;
  Mapping &operator=(const Mapping &) = delete;
  const uint8_t *at(size_t offset) const {
    return static_cast<const uint8_t *>(start_) + offset;
  }
  /* Tells the kernel that the processor reads what the camera wrote; memory that needs no telling refuses it. */
  void reading(bool begins) const {
    struct dma_buf_sync sync = {};
    sync.flags = DMA_BUF_SYNC_READ | (begins ? DMA_BUF_SYNC_START : DMA_BUF_SYNC_END);
    ioctl(descriptor_, DMA_BUF_IOCTL_SYNC, &sync);
  }

private:
  int descriptor_;
  size_t size_;
  void *start_;
};

/* A request with its buffer. */
struct Slot {
  std::unique_ptr<Request> request;
  FrameBuffer *buffer;
  std::vector<std::shared_ptr<Mapping>> planes;
  std::vector<uint8_t> gathered; /* planes that do not lie one after the other */
  uint32_t revision = 0;
};

int64_t clock_ns(clockid_t clock) {
  struct timespec now;
  clock_gettime(clock, &now);
  return now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

/* libcamera counts SensorTimestamp by CLOCK_BOOTTIME, but handlers pass on what the kernel stamped by CLOCK_MONOTONIC.
 * The two differ by the time that the machine has slept, and a stamp that lies ahead can only be of the former. */
int64_t to_monotonic(int64_t stamp_ns) {
  int64_t now_ns = clock_ns(CLOCK_MONOTONIC);
  return stamp_ns <= now_ns ? stamp_ns : stamp_ns - (clock_ns(CLOCK_BOOTTIME) - now_ns);
}

} // namespace

/* Lives with the caller; libcamera's thread reaches it through completed() and disconnected(), until close(). */
struct clt_libcamera {
  ~clt_libcamera();
  void open(const clt_camera_config &config, clt_libcamera_stream *agreed);
  void set_exposure(double seconds, uint32_t *revision);
  void take(int64_t deadline_ns, clt_libcamera_picture *picture);

private:
  void find(const std::string &name);
  void acquire();
  void allocate();
  void add_slot(FrameBuffer *buffer);
  void start();
  void queue(Slot *slot);
  void completed(Request *request);
  void disconnected();
  void view(Slot *slot, clt_libcamera_picture *picture);
  [[noreturn]] void fail(clt_status status, const std::string &what, int problem) const;

  clt::Manager manager_; /* outlives the camera */
  std::shared_ptr<Camera> camera_;
  bool acquired_ = false, connected_ = false;
  std::unique_ptr<libcamera::CameraConfiguration> configuration_;
  std::unique_ptr<libcamera::FrameBufferAllocator> allocator_;
  std::vector<Slot> slots_; /* all in place before the camera starts */

  std::mutex lock_; /* guards all below */
  std::condition_variable changed_;
  clt::Stages stages_;    /* settings that have not gone out yet */
  uint32_t revision_ = 0; /* of the last of them */
  std::deque<Slot *> ready_;
  Slot *held_ = nullptr; /* with the caller */
  bool gone_ = false, stopping_ = false;
};

void clt_libcamera::fail(clt_status status, const std::string &what, int problem) const {
  throw Failure{status, "camera \"" + camera_->id() + "\" " + what +
                            (problem != 0 ? std::string(": ") + strerror(problem < 0 ? -problem : problem) : "")};
}

/* "auto", an identifier or its end, or a model. */
void clt_libcamera::find(const std::string &name) {
  std::string listed;
  for (const std::shared_ptr<Camera> &camera : manager_.cameras()) {
    const std::string &id = camera->id();
    bool ends = id.size() > name.size() && id.compare(id.size() - name.size(), name.size(), name) == 0;
    if (camera_ == nullptr &&
        (name == "auto" || name.empty() || id == name || ends || clt::model_of(*camera) == name)) {
      camera_ = camera;
    }
    listed += (listed.empty() ? "\"" : ", \"") + id + "\"";
  }
  if (camera_ == nullptr) {
    throw Failure{
        CLT_GONE,
        (name == "auto" ? "libcamera finds no camera" : "libcamera finds no camera \"" + name + "\"") +
            (listed.empty() ? "; plug one in, or check that this user may open it" : "; there are: " + listed)};
  }
}

void clt_libcamera::acquire() {
  int problem = camera_->acquire();
  if (problem == -EBUSY) {
    fail(CLT_FAILED, "is in use; end the other program that has it", 0);
  }
  if (problem != 0) {
    fail(CLT_GONE, "cannot be had", problem);
  }
  acquired_ = true;
}

/* Planes of one buffer may share their memory. */
void clt_libcamera::add_slot(FrameBuffer *buffer) {
  Slot slot;
  slot.buffer = buffer;
  slot.request = camera_->createRequest(slots_.size());
  if (slot.request == nullptr || slot.request->addBuffer(configuration_->at(0).stream(), buffer) != 0) {
    fail(CLT_FAILED, "makes no request", 0);
  }
  std::map<int, size_t> sizes;
  for (const FrameBuffer::Plane &plane : buffer->planes()) {
    size_t &size = sizes[plane.fd.get()];
    size = std::max(size, size_t(plane.offset) + plane.length);
  }
  std::map<int, std::shared_ptr<Mapping>> mapped;
  for (const FrameBuffer::Plane &plane : buffer->planes()) {
    std::shared_ptr<Mapping> &memory = mapped[plane.fd.get()];
    if (memory == nullptr) {
      memory = std::make_shared<Mapping>(plane.fd.get(), sizes[plane.fd.get()]);
    }
    slot.planes.push_back(memory);
  }
  slots_.push_back(std::move(slot));
}

void clt_libcamera::allocate() {
  libcamera::Stream *stream = configuration_->at(0).stream();
  allocator_ = std::make_unique<libcamera::FrameBufferAllocator>(camera_);
  int count = allocator_->allocate(stream);
  if (count < int(READY_MOST) + 2) {
    fail(CLT_FAILED, "gives too few buffers", count < 0 ? count : 0);
  }
  for (const std::unique_ptr<FrameBuffer> &buffer : allocator_->buffers(stream)) {
    add_slot(buffer.get());
  }
}

void clt_libcamera::start() {
  camera_->requestCompleted.connect(this, &clt_libcamera::completed);
  camera_->disconnected.connect(this, &clt_libcamera::disconnected);
  connected_ = true;
  int problem = camera_->start(&stages_.front());
  if (problem != 0) {
    fail(CLT_FAILED, "does not start", problem);
  }
  std::lock_guard<std::mutex> held(lock_);
  for (Slot &slot : slots_) {
    queue(&slot);
  }
}

void clt_libcamera::open(const clt_camera_config &config, clt_libcamera_stream *agreed) {
  find(config.device);
  acquire();
  configuration_ = clt::choose(*camera_, config, BUFFERS, agreed);
  int problem = camera_->configure(configuration_.get());
  if (problem != 0) {
    fail(CLT_FAILED, "cannot be configured", problem);
  }
  agreed->stride = configuration_->at(0).stride;
  agreed->size = configuration_->at(0).frameSize;
  snprintf(agreed->id, sizeof agreed->id, "%s", camera_->id().c_str());
  clt::read_exposure_range(*camera_, agreed);
  stages_ = clt::make_stages(*camera_, config, *agreed);
  revision_ = static_cast<uint32_t>(stages_.size());
  allocate();
  start();
}

/* With lock_ held, and the slot in nobody else's hands. What cannot be queued is a camera on its way out. */
void clt_libcamera::queue(Slot *slot) {
  slot->request->reuse(Request::ReuseBuffers);
  if (!stages_.empty()) {
    for (const auto &[id, value] : stages_.front()) {
      slot->request->controls().set(id, value);
    }
    stages_.pop_front();
  }
  slot->revision = revision_ - static_cast<uint32_t>(stages_.size());
  if (camera_->queueRequest(slot->request.get()) != 0) {
    gone_ = true;
    changed_.notify_all();
  }
}

/* On libcamera's thread. */
void clt_libcamera::completed(Request *request) {
  std::lock_guard<std::mutex> held(lock_);
  if (stopping_ || gone_ || request->status() == Request::RequestCancelled) {
    return;
  }
  Slot *slot = &slots_[request->cookie()];
  if (slot->buffer->metadata().status != libcamera::FrameMetadata::FrameSuccess) {
    queue(slot);
    return;
  }
  ready_.push_back(slot);
  if (ready_.size() > READY_MOST) {
    Slot *oldest = ready_.front();
    ready_.pop_front();
    queue(oldest);
  }
  changed_.notify_all();
}

/* On libcamera's thread. */
void clt_libcamera::disconnected() {
  std::lock_guard<std::mutex> held(lock_);
  gone_ = true;
  changed_.notify_all();
}

void clt_libcamera::set_exposure(double seconds, uint32_t *revision) {
  ControlList exposure = clt::make_exposure(*camera_, seconds);
  std::lock_guard<std::mutex> held(lock_);
  stages_.push_back(exposure);
  *revision = ++revision_;
}

/* One run of bytes: as it lies, or gathered where the planes do not follow each other. */
void clt_libcamera::view(Slot *slot, clt_libcamera_picture *picture) {
  const auto &planes = slot->buffer->planes();
  const auto told = slot->buffer->metadata().planes();
  bool apart = false;
  size_t used = 0;
  for (size_t k = 0; k < planes.size(); k++) {
    slot->planes[k]->reading(true);
    apart = apart || slot->planes[k]->at(planes[k].offset) != slot->planes[0]->at(planes[0].offset) + used;
    used += k + 1 < planes.size() ? planes[k].length : told[k].bytesused;
  }
  picture->bytes = slot->planes[0]->at(planes[0].offset);
  picture->used = used;
  if (apart) {
    slot->gathered.clear();
    for (size_t k = 0; k < planes.size(); k++) {
      const uint8_t *start = slot->planes[k]->at(planes[k].offset);
      slot->gathered.insert(slot->gathered.end(), start, start + told[k].bytesused);
    }
    picture->bytes = slot->gathered.data();
    picture->used = slot->gathered.size();
  }
  picture->sequence = slot->buffer->metadata().sequence;
  picture->revision = slot->revision;
  picture->stamp_ns = static_cast<int64_t>(slot->buffer->metadata().timestamp);
  clt::read_metadata(*slot->request, picture);
  picture->stamp_ns = to_monotonic(picture->stamp_ns);
}

void clt_libcamera::take(int64_t deadline_ns, clt_libcamera_picture *picture) {
  std::chrono::steady_clock::time_point deadline{std::chrono::nanoseconds(deadline_ns)};
  std::unique_lock<std::mutex> held(lock_);
  if (held_ != nullptr && !gone_) {
    for (const std::shared_ptr<Mapping> &plane : held_->planes) {
      plane->reading(false);
    }
    Slot *before = held_;
    held_ = nullptr;
    queue(before);
  }
  changed_.wait_until(held, deadline, [this] { return gone_ || !ready_.empty(); });
  if (gone_) {
    fail(CLT_GONE, "is gone; plug it in again", 0);
  }
  if (ready_.empty()) {
    fail(CLT_TIMEOUT, "sent no picture in time; check its connection", 0);
  }
  held_ = ready_.front();
  ready_.pop_front();
  view(held_, picture);
}

/* A camera that has gone is no longer stopped by libcamera, whose thread may be about to complete a request: stop(),
 * called on that thread, does nothing more and returns when all before it is done. */
clt_libcamera::~clt_libcamera() {
  {
    std::lock_guard<std::mutex> held(lock_);
    stopping_ = true;
  }
  if (connected_) {
    camera_->stop();
    camera_->invokeMethod(&Camera::stop, libcamera::ConnectionTypeBlocking);
    camera_->requestCompleted.disconnect(this);
    camera_->disconnected.disconnect(this);
  }
  slots_.clear();
  allocator_.reset();
  if (acquired_) {
    camera_->release();
  }
}

clt_status clt_libcamera_open(const clt_camera_config *config, clt_libcamera **out, clt_libcamera_stream *stream,
                              clt_error *error) {
  *out = nullptr;
  *stream = {};
  return clt::guarded(error, [&] {
    auto camera = std::make_unique<clt_libcamera>();
    camera->open(*config, stream);
    *out = camera.release();
  });
}

clt_status clt_libcamera_set_exposure(clt_libcamera *camera, double seconds, uint32_t *revision, clt_error *error) {
  return clt::guarded(error, [&] { camera->set_exposure(seconds, revision); });
}

clt_status clt_libcamera_take(clt_libcamera *camera, int64_t deadline_ns, clt_libcamera_picture *picture,
                              clt_error *error) {
  *picture = {};
  return clt::guarded(error, [&] { camera->take(deadline_ns, picture); });
}

void clt_libcamera_close(clt_libcamera *camera) {
  clt::guarded(nullptr, [&] { delete camera; });
}
