#pragma once
// Answers common to all pages of the program: the page itself, and the newest image with its tracks.
#include <string>
#include <string_view>

#include "drivers/program/view/http_server.h"
#include "drivers/program/view/view_feed.h"

namespace epiline {

/// Answers with a page. A new nonce permits its own script and style only, and these may contact this server only.
HttpResponse page_answer(std::string_view html);

/// The newest image of a feed. One thread uses it.
class ServedImage {
 public:
  explicit ServedImage(ViewFeed& feed) : feed_(feed) {}
  /// Takes the newest image from the feed. True: it is a new one.
  bool refresh();
  /// Sequence number of the newest image, plus one; 0: no image yet.
  std::uint64_t next_sequence() const { return image_ == nullptr ? 0 : image_->sequence + 1; }
  /// Answers /frame, whose body is the length of a header (32 bits, little-endian), the header in JSON, and the image
  /// as JPEG; and /image, which is that JPEG. Any other path is unknown.
  HttpResponse answer(std::string_view path);

 private:
  void encode();

  ViewFeed& feed_;
  const ViewedImage* image_ = nullptr;  ///< newest; lent by the feed
  std::string jpeg_, tracks_;           ///< of that image
  bool encoded_ = false;
};

}  // namespace epiline
