#pragma once
// Answers that every page of the program gives: itself, and the newest image with its tracks.
#include <string>
#include <string_view>

#include "drivers/program/view/http_server.h"
#include "drivers/program/view/view_feed.h"

namespace epiline {

/// A page with a key for its script and style, so that only these run; they may ask this server alone.
HttpResponse page_answer(std::string_view html);

/// The newest image of a feed. One thread.
class ServedImage {
 public:
  explicit ServedImage(ViewFeed& feed) : feed_(feed) {}
  /// Takes what the feed has. True: a new image.
  bool refresh();
  /// Of the newest image, plus one; 0: none came.
  std::uint64_t next_sequence() const { return image_ == nullptr ? 0 : image_->sequence + 1; }
  /// Length of the header (32 bit, least byte first), header in JSON, JPEG.
  HttpResponse frame();
  HttpResponse jpeg();

 private:
  void encode();

  ViewFeed& feed_;
  const ViewedImage* image_ = nullptr;  ///< newest; lent by the feed
  std::string jpeg_, tracks_;           ///< of that image
  bool encoded_ = false;
};

}  // namespace epiline
