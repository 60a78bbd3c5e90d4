#include "drivers/program/dds/participant.h"

#ifdef EPILINE_CYCLONEDDS

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <dlfcn.h>
#include <pthread.h>

#include <cstring>
#include <memory>
#include <string>

#endif

namespace epiline {

#ifndef EPILINE_CYCLONEDDS

Status DdsParticipant::open(int /*domain*/, std::span<const DdsTopic> /*topics*/) {
  return Error{ErrorKind::kUsage, "", 0, "built without Cyclone DDS", "a build with cyclonedds-dev installed"};
}
void DdsParticipant::close() noexcept {}
bool DdsParticipant::write(std::size_t /*topic*/, std::string_view /*message*/) { return false; }

#else

namespace {

/// What is used of Cyclone DDS.
struct Cyclone {
  void* const library = dlopen(EPILINE_CYCLONEDDS, RTLD_NOW | RTLD_LOCAL);
  bool is_whole = library != nullptr;
  const std::string trouble = is_whole ? "" : dlerror();

// NOLINTNEXTLINE(bugprone-macro-parentheses): it is a name
#define EPILINE_DDS(name) decltype(&::name) name = find<decltype(&::name)>(#name)
  EPILINE_DDS(dds_create_participant);
  EPILINE_DDS(dds_create_qos);
  EPILINE_DDS(dds_create_topic_sertype);
  EPILINE_DDS(dds_create_writer);
  EPILINE_DDS(dds_delete);
  EPILINE_DDS(dds_delete_qos);
  EPILINE_DDS(dds_qset_data_representation);
  EPILINE_DDS(dds_qset_history);
  EPILINE_DDS(dds_qset_reliability);
  EPILINE_DDS(dds_qset_userdata);
  EPILINE_DDS(dds_set_log_sink);
  EPILINE_DDS(dds_strretcode);
  EPILINE_DDS(dds_writecdr);
  EPILINE_DDS(ddsi_serdata_init);
  EPILINE_DDS(ddsi_sertype_fini);
  EPILINE_DDS(ddsi_sertype_init);
  EPILINE_DDS(ddsi_sertype_unref);
  EPILINE_DDS(ddsi_sertype_v0);
#undef EPILINE_DDS

 private:
  template <class Function>
  Function find(const char* name) {
    void* const symbol = library != nullptr ? dlsym(library, name) : nullptr;
    is_whole = is_whole && symbol != nullptr;
    return reinterpret_cast<Function>(symbol);
  }
};

const Cyclone& cyclone() {
  static const Cyclone loaded;
  return loaded;
}

/// Bytes that Cyclone DDS holds until they are sent and acknowledged.
struct Message : ddsi_serdata {
  std::string bytes;
};

const std::string& bytes_of(const ddsi_serdata* message) { return static_cast<const Message*>(message)->bytes; }

/// What Cyclone DDS asks of a message without a key that is only written; what readers would need is null.
const ddsi_serdata_ops& message_ops() {
  static const ddsi_serdata_ops ops = [] {
    ddsi_serdata_ops o{};
    o.eqkey = [](const ddsi_serdata*, const ddsi_serdata*) { return true; };
    o.get_size = [](const ddsi_serdata* m) { return static_cast<std::uint32_t>(bytes_of(m).size()); };
    o.to_ser = [](const ddsi_serdata* m, std::size_t from, std::size_t size, void* to) {
      std::memcpy(to, bytes_of(m).data() + from, size);
    };
    o.to_ser_ref = [](const ddsi_serdata* m, std::size_t from, std::size_t size, ddsrt_iovec_t* to) {
      *to = {const_cast<char*>(bytes_of(m).data()) + from, size};
      return ddsi_serdata_ref(m);
    };
    o.to_ser_unref = [](ddsi_serdata* m, const ddsrt_iovec_t*) { ddsi_serdata_unref(m); };
    o.to_untyped = [](const ddsi_serdata* m) { return ddsi_serdata_ref(m); };
    o.free = [](ddsi_serdata* m) { delete static_cast<Message*>(m); };
    o.print = [](const ddsi_sertype*, const ddsi_serdata*, char* text, std::size_t) -> std::size_t {
      return *text = 0;
    };
    o.get_keyhash = [](const ddsi_serdata*, ddsi_keyhash* hash, bool) { *hash = {}; };
    return o;
  }();
  return ops;
}

const ddsi_sertype_ops& type_ops() {
  static const ddsi_sertype_ops ops = [] {
    ddsi_sertype_ops o{};
    o.version = cyclone().ddsi_sertype_v0;
    o.free = [](ddsi_sertype* type) {
      cyclone().ddsi_sertype_fini(type);
      delete type;
    };
    o.equal = [](const ddsi_sertype*, const ddsi_sertype*) { return true; };  // asked where the names are
    o.hash = [](const ddsi_sertype*) { return 0U; };
    return o;
  }();
  return ops;
}

/// As ROS 2's publishers are unless told otherwise: readers that want all of it and readers that do not both match.
dds_qos_t* make_qos(const DdsTopic& topic) {
  constexpr int kDepth = 10;
  constexpr dds_data_representation_id_t kCdr = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qos_t* const qos = cyclone().dds_create_qos();
  cyclone().dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  cyclone().dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, kDepth);
  cyclone().dds_qset_data_representation(qos, 1, &kCdr);
  const std::string hash = std::string("typehash=") + topic.hash + ";";
  cyclone().dds_qset_userdata(qos, hash.data(), hash.size());
  return qos;
}

/// A log of Cyclone DDS that keeps the last line, without its time and domain.
void keep_last(void* text, const dds_log_data_t* line) {
  static_cast<std::string*>(text)->assign(line->message, std::strcspn(line->message, "\n"));
}

/// Negative: failed, and why is in `trouble`. Here Cyclone DDS starts its threads. Their stacks would have 8 MiB each,
/// all of it locked in memory as the process' other memory is.
dds_entity_t join_domain(int domain, std::string& trouble) {
  constexpr std::size_t kStack = 512 * 1024;
  pthread_attr_t usual, small;
  pthread_getattr_default_np(&usual);
  pthread_getattr_default_np(&small);
  pthread_attr_setstacksize(&small, kStack);
  pthread_setattr_default_np(&small);
  cyclone().dds_set_log_sink(keep_last, &trouble);
  const auto made = cyclone().dds_create_participant(static_cast<dds_domainid_t>(domain), nullptr, nullptr);
  cyclone().dds_set_log_sink(nullptr, nullptr);
  pthread_setattr_default_np(&usual);
  pthread_attr_destroy(&small);
  pthread_attr_destroy(&usual);
  return made;
}

}  // namespace

Status DdsParticipant::open(int domain, std::span<const DdsTopic> topics) {
  const Cyclone& dds = cyclone();
  if (!dds.is_whole)
    return Error{ErrorKind::kUsage, "", 0, dds.trouble.empty() ? EPILINE_CYCLONEDDS " is another version" : dds.trouble,
                 "the package " EPILINE_CYCLONEDDS_PACKAGE};
  std::string trouble;
  const auto failed = [&](std::int32_t code) {
    close();
    return Error{ErrorKind::kRun, "", 0,
                 "cannot join DDS domain " + std::to_string(domain) + ": " +
                     (trouble.empty() ? dds.dds_strretcode(code) : trouble),
                 "a network interface that is up (CYCLONEDDS_URI)"};
  };
  entity_ = join_domain(domain, trouble);
  if (entity_ < 0) return failed(entity_);
  for (const DdsTopic& topic : topics) {
    auto* type = new ddsi_sertype();
    dds.ddsi_sertype_init(type, topic.type, &type_ops(), &message_ops(), true);
    const dds_entity_t made = dds.dds_create_topic_sertype(entity_, topic.name, &type, nullptr, nullptr, nullptr);
    if (made < 0) {
      dds.ddsi_sertype_unref(type);
      return failed(made);
    }
    dds_qos_t* const qos = make_qos(topic);
    const dds_entity_t writer = dds.dds_create_writer(entity_, made, qos, nullptr);
    dds.dds_delete_qos(qos);
    if (writer < 0) return failed(writer);
    writers_.push_back({writer, type});
  }
  return Done{};
}

void DdsParticipant::close() noexcept {
  if (entity_ > 0) cyclone().dds_delete(entity_);
  entity_ = 0;
  writers_.clear();
}

bool DdsParticipant::write(std::size_t topic, std::string_view message) {
  if (topic >= writers_.size()) return false;
  const Writer& writer = writers_[topic];
  auto serdata = std::make_unique<Message>();
  cyclone().ddsi_serdata_init(serdata.get(), static_cast<const ddsi_sertype*>(writer.type), SDK_DATA);
  serdata->bytes = message;
  serdata->bytes.resize((message.size() + 3) / 4 * 4);  // as RTPS wants it
  return cyclone().dds_writecdr(writer.entity, serdata.release()) == DDS_RETCODE_OK;
}

#endif

}  // namespace epiline
