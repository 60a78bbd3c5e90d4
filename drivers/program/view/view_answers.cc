#include "drivers/program/view/view_answers.h"

#include "drivers/flights/recordings/image_codecs.h"
#include "drivers/program/view/view_address.h"
#include "drivers/program/view/view_model.h"

namespace epiline {

namespace {

void append_u32(std::string& bytes, std::size_t value) {
  for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<char>(value >> shift & 0xff));
}

}  // namespace

HttpResponse page_answer(std::string_view page) {
  const std::string key = new_token();
  std::string html(page);
  for (std::size_t at = 0; (at = html.find("@NONCE@", at)) != std::string::npos;) html.replace(at, 7, key);
  return {200, "text/html; charset=utf-8", std::move(html),
          "default-src 'none'; script-src 'nonce-" + key + "'; style-src 'nonce-" + key +
              "'; connect-src 'self'; img-src 'self' blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors "
              "'none'"};
}

bool ServedImage::refresh() {
  const ViewedImage* const newest = feed_.newest_image();
  if (newest == nullptr) return false;
  image_ = newest;
  encoded_ = false;
  return true;
}

HttpResponse ServedImage::answer(std::string_view path) {
  const bool is_frame = path == "/frame";
  if (!is_frame && path != "/image") return {404, "text/plain", "there are /, /state, /image and /frame\n", ""};
  if (image_ == nullptr || (!is_frame && image_->width == 0)) return {404, "text/plain", "no image yet\n", ""};
  encode();
  if (!is_frame) return {200, "image/jpeg", jpeg_, ""};
  std::string body;
  append_u32(body, tracks_.size());
  return {200, "application/octet-stream", body + tracks_ + jpeg_, ""};
}

/// Once an image, however many look.
void ServedImage::encode() {
  if (encoded_) return;
  encoded_ = true;
  tracks_ = tracks_json(*image_);
  jpeg_.clear();
  if (image_->width == 0) return;
  jpeg_ = jpeg_of({image_->pixels.data(), image_->width, image_->height, image_->width}, 80);
}

}  // namespace epiline
