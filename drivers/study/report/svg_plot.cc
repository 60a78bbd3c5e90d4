#include "drivers/study/report/svg_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

namespace epiline {

namespace {

constexpr double kLeft = 58, kRight = 14, kTop = 26, kBottom = 40;
constexpr std::size_t kMostPoints = 2000;  // more than a screen can show

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void add(double v) {
    if (!std::isfinite(v)) return;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  void add(const std::vector<double>& values) {
    for (const double v : values) add(v);
  }
  double length() const { return high - low; }
  /// Not empty, not a point, with a margin on both sides.
  void finish(double margin) {
    if (!(low <= high)) *this = {0, 1};
    if (length() < 1e-12) *this = {low - 0.5, high + 0.5};
    const double m = margin * length();
    low -= m;
    high += m;
  }
};

/// Data to pixels.
struct Frame2 {
  PlotSize size;
  Range x, y;
  double px(double v) const { return kLeft + (v - x.low) / x.length() * (size.width - kLeft - kRight); }
  double py(double v) const {
    return size.height - kBottom - (v - y.low) / y.length() * (size.height - kTop - kBottom);
  }
};

/// 1, 2 or 5 times a power of ten, giving about `count` steps.
double tick_step(double length, int count) {
  const double rough = length / count, power = std::pow(10, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= rough) return factor * power;
  }
  return 10 * power;
}

std::string tick_text(double v, double step) {
  if (std::abs(v) < 1e-9 * step) v = 0;
  const int decimals = std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9)));
  if (decimals > 4) return fmt::format("{:.0e}", v);
  return fmt::format("{:.{}f}", v, decimals);
}

std::string y_axis(const Frame2& f, const std::string& label) {
  std::string s;
  const double bottom = f.size.height - kBottom, right = f.size.width - kRight;
  const double y_step = tick_step(f.y.length(), static_cast<int>(f.size.height / 50));
  for (double v = std::ceil(f.y.low / y_step) * y_step; v <= f.y.high; v += y_step) {
    s += fmt::format(
        R"(<path class="grid" d="M{0} {1:.1f}H{2}"/><text class="tick" x="{3}" y="{4:.1f}" text-anchor="end">{5}</text>)",
        kLeft, f.py(v), right, kLeft - 6, f.py(v) + 3.5, tick_text(v, y_step));
  }
  s += fmt::format(
      R"svg(<text class="label" transform="translate(13 {:.1f}) rotate(-90)" text-anchor="middle">{}</text>)svg",
      0.5 * (kTop + bottom), escaped(label));
  return s;
}

std::string x_tick(const Frame2& f, double at, const std::string& text) {
  const double bottom = f.size.height - kBottom;
  return fmt::format(
      R"(<path class="grid" d="M{0:.1f} {1}V{2}"/><text class="tick" x="{0:.1f}" y="{3}" text-anchor="middle">{4}</text>)",
      f.px(at), kTop, bottom, bottom + 15, text);
}

/// At 1, 2 and 5 of each decade; the axis holds logarithms.
std::string logarithmic_ticks(const Frame2& f) {
  std::string s;
  for (double decade = std::pow(10, std::floor(f.x.low)); std::log10(decade) <= f.x.high; decade *= 10) {
    for (const double digit : {1, 2, 5}) {
      const double at = std::log10(digit * decade);
      if (at >= f.x.low && at <= f.x.high) s += x_tick(f, at, fmt::format("{:g}", digit * decade));
    }
  }
  return s;
}

std::string axes(const Frame2& f, const std::string& x_label, const std::string& y_label, bool logarithmic = false) {
  std::string s = logarithmic ? logarithmic_ticks(f) : "";
  const double right = f.size.width - kRight;
  const double x_step = tick_step(f.x.length(), 8);
  for (double v = std::ceil(f.x.low / x_step) * x_step; v <= f.x.high && !logarithmic; v += x_step)
    s += x_tick(f, v, tick_text(v, x_step));
  s += y_axis(f, y_label);
  s += fmt::format(R"(<text class="label" x="{:.1f}" y="{}" text-anchor="middle">{}</text>)", 0.5 * (kLeft + right),
                   f.size.height - 6, escaped(x_label));
  return s;
}

/// Every how-manieth point is drawn.
std::size_t stride_for(std::size_t points) {
  return std::max<std::size_t>(1, (points + kMostPoints - 1) / kMostPoints);
}

std::string line_path(const Frame2& f, const PlotLine& line) {
  std::string d;
  bool pen_down = false;
  for (std::size_t i = 0; i < line.x.size(); i += stride_for(line.x.size())) {
    if (!std::isfinite(line.x[i]) || !std::isfinite(line.y[i])) {
      pen_down = false;
      continue;
    }
    d += fmt::format("{}{:.1f} {:.1f}", pen_down ? "L" : "M", f.px(line.x[i]), f.py(line.y[i]));
    pen_down = true;
  }
  return fmt::format(R"(<path class="line {}" d="{}"/>)", line.style, d);
}

std::string band_path(const Frame2& f, const PlotBand& band) {
  const std::size_t stride = stride_for(band.x.size());
  std::string s;
  std::string there, back;  // one polygon for each stretch without gaps
  const auto close = [&] {
    if (!there.empty())
      s += fmt::format(R"(<path class="band {}" d="M{}L{}Z"/>)", band.style, there.substr(1), back.substr(1));
    there.clear();
    back.clear();
  };
  for (std::size_t i = 0; i < band.x.size(); i += stride) {
    if (!std::isfinite(band.low[i]) || !std::isfinite(band.high[i])) {
      close();
      continue;
    }
    there += fmt::format("L{:.1f} {:.1f}", f.px(band.x[i]), f.py(band.high[i]));
    back = fmt::format("L{:.1f} {:.1f}", f.px(band.x[i]), f.py(band.low[i])) + back;
  }
  close();
  return s;
}

Frame2 frame_of(const Plot& plot, PlotSize size) {
  Frame2 f{size, {}, {}};
  for (const PlotLine& line : plot.lines) {
    f.x.add(line.x);
    f.y.add(line.y);
  }
  for (const PlotBand& band : plot.bands) {
    f.x.add(band.x);
    f.y.add(band.low);
    f.y.add(band.high);
  }
  for (const PlotSpan& span : plot.spans) {
    f.x.add(span.from);
    f.x.add(span.to);
  }
  if (plot.from_zero) f.y.add(0);
  if (plot.y_cap > 0) {
    f.y.high = std::min(f.y.high, plot.y_cap);
    f.y.low = std::max(f.y.low, -plot.y_cap);
  }
  f.x.finish(plot.equal_axes ? 0.05 : 0);
  f.y.finish(0.06);
  if (plot.from_zero) f.y.low = 0;
  if (plot.equal_axes) {
    const double per_x = f.x.length() / (size.width - kLeft - kRight),
                 per_y = f.y.length() / (size.height - kTop - kBottom);
    Range& shorter = per_x < per_y ? f.x : f.y;
    shorter.finish(0.5 * (std::max(per_x, per_y) / std::min(per_x, per_y) - 1));
  }
  return f;
}

std::string legend(const std::vector<PlotLine>& lines, PlotSize size) {
  double x = size.width - kRight - 6;
  std::string s;
  for (auto line = lines.rbegin(); line != lines.rend(); ++line) {
    if (line->label.empty()) continue;
    s += fmt::format(R"(<text class="legend" x="{:.0f}" y="{}" text-anchor="end">{}</text>)", x, kTop - 9,
                     escaped(line->label));
    x -= 6 * static_cast<double>(line->label.size()) + 12;
    s += fmt::format(R"(<path class="line {}" d="M{:.0f} {}h-16"/>)", line->style, x, kTop - 13);
    x -= 28;
  }
  return s;
}

/// The drawing with its frame, grid and labels; what is drawn into `inside` is cut off at the axes.
std::string drawing(const Frame2& f, const std::string& below, const std::string& grid, const std::string& inside,
                    const std::string& above) {
  // The clipping area lies in an inner <svg>, which cuts off by itself: no names that could clash in a page with many
  // drawings.
  const double width = f.size.width - kLeft - kRight, height = f.size.height - kTop - kBottom;
  const auto clipped = [&](const std::string& content) {
    return fmt::format(R"(<svg x="{0}" y="{1}" width="{2}" height="{3}" viewBox="{0} {1} {2} {3}">{4}</svg>)", kLeft,
                       kTop, width, height, content);
  };
  return fmt::format(R"(<svg viewBox="0 0 {} {}" role="img">{}{}{}{}</svg>)", f.size.width, f.size.height,
                     clipped(below), grid, clipped(inside), above);
}

}  // namespace

std::string escaped(const std::string& text) {
  constexpr std::pair<char, const char*> kEntities[] = {{'<', "&lt;"}, {'>', "&gt;"}, {'&', "&amp;"}, {'"', "&quot;"}};
  std::string s;
  for (const char c : text) {
    const auto* entity =
        std::find_if(std::begin(kEntities), std::end(kEntities), [&](const auto& e) { return e.first == c; });
    if (entity == std::end(kEntities))
      s += c;
    else
      s += entity->second;
  }
  return s;
}

std::string svg(const Plot& plot, PlotSize size) {
  const Frame2 f = frame_of(plot, size);
  std::string spans, inside;
  for (const PlotSpan& span : plot.spans) {
    spans += fmt::format(R"(<rect class="span {}" x="{:.1f}" y="{}" width="{:.1f}" height="{}"/>)", span.style,
                         f.px(span.from), kTop, std::max(0.0, f.px(span.to) - f.px(span.from)),
                         size.height - kTop - kBottom);
  }
  for (const PlotBand& band : plot.bands) inside += band_path(f, band);
  for (const PlotLine& line : plot.lines) inside += line_path(f, line);
  for (const PlotMark& mark : plot.marks) {
    const double x = f.px(mark.x), y = f.py(mark.y);
    const bool right = x > size.width - 80;  // no room for the label on the right
    inside += fmt::format(
        R"(<circle class="mark {0}" cx="{1:.1f}" cy="{2:.1f}" r="4"/><text class="legend" x="{3:.1f}" y="{4:.1f}" text-anchor="{5}">{6}</text>)",
        mark.style, x, y, x + (right ? -7 : 7), y - 6, right ? "end" : "start", escaped(mark.label));
  }
  return drawing(f, spans, axes(f, plot.x_label, plot.y_label), inside, legend(plot.lines, size));
}

std::string svg(const Histogram& histogram, PlotSize size) {
  constexpr std::size_t kBars = 40;
  constexpr double kLeast = 1e-3;  // of a logarithmic axis
  const auto scaled = [&](double v) { return histogram.logarithmic ? std::log10(std::max(v, kLeast)) : v; };
  double low = 0;
  if (histogram.logarithmic && !histogram.values.empty())
    low = scaled(*std::min_element(histogram.values.begin(), histogram.values.end()));
  const double high = std::max(scaled(histogram.upper), low + 1e-3);
  std::vector<double> counts(kBars, 0);
  for (const double v : histogram.values) {
    const double bar = (scaled(v) - low) / (high - low) * kBars;
    counts[static_cast<std::size_t>(std::clamp(bar, 0.0, kBars - 1.0))] += 1;
  }
  Frame2 f{size, {low, high}, {0, 1.15 * std::max(1.0, *std::max_element(counts.begin(), counts.end()))}};
  std::string s;
  const double width = (f.px(high) - f.px(low)) / kBars;
  for (std::size_t i = 0; i < kBars; ++i) {
    if (counts[i] == 0) continue;
    s += fmt::format(R"(<rect class="bar {}" x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}"/>)", histogram.style,
                     kLeft + static_cast<double>(i) * width + 0.5, f.py(counts[i]), width - 1,
                     f.py(0) - f.py(counts[i]));
  }
  double label_y = kTop + 10;
  for (const PlotMark& mark : histogram.marks) {
    const double x = f.px(std::min(scaled(mark.x), high));
    const bool right_half = x > 0.7 * size.width;
    s += fmt::format(
        R"(<path class="rule" d="M{0:.1f} {1}V{2}"/><text class="legend" x="{3:.1f}" y="{4}" text-anchor="{5}">{6}</text>)",
        x, kTop, size.height - kBottom, x + (right_half ? -5 : 5), label_y, right_half ? "end" : "start",
        escaped(mark.label));
    label_y += 14;
  }
  return drawing(f, "", axes(f, histogram.x_label, histogram.y_label, histogram.logarithmic), s, "");
}

}  // namespace epiline
