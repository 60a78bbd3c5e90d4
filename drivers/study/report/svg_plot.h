#pragma once
// Line charts as SVG text, to be put into a page that defines their colours (report.cc).
#include <string>
#include <vector>

namespace epiline {

/// One line of a chart. Points that are not finite interrupt it. `style` is a CSS class: c1 to c4, truth, thin, dashed.
struct PlotLine {
  std::string label;  ///< empty: not in the legend
  std::string style;
  std::vector<double> x = {}, y = {};
  void add(double at, double value) {
    x.push_back(at);
    y.push_back(value);
  }
};

/// An area between two lines over the same x.
struct PlotBand {
  std::string style;
  std::vector<double> x, low, high;
};

/// A range of x with a coloured background.
struct PlotSpan {
  std::string style;
  double from = 0, to = 0;
};

struct PlotMark {
  std::string label, style;
  double x = 0, y = 0;
};

struct Plot {
  std::string x_label, y_label;
  bool equal_axes = false;  ///< a metre is as long in x as in y
  bool from_zero = false;   ///< y starts at zero
  double y_cap = 0;         ///< if above zero: larger values are cut off at this
  std::vector<PlotSpan> spans = {};
  std::vector<PlotBand> bands = {};
  std::vector<PlotLine> lines = {};
  std::vector<PlotMark> marks = {};
};

struct PlotSize {
  double width = 560, height = 260;
};

std::string svg(const Plot& plot, PlotSize size = {});

/// Bars of equal width over [0, upper], values above in the last one; vertical lines at the marks (x only).
struct Histogram {
  std::string x_label, style;
  std::string y_label = "images";  ///< what is counted
  std::vector<double> values = {};
  double upper = 1;
  std::vector<PlotMark> marks = {};
  bool logarithmic = false;  ///< axis and bars from the smallest value to the largest, which is what `upper` is then
};
std::string svg(const Histogram& histogram, PlotSize size = {});

/// Text for HTML and SVG.
std::string escaped(const std::string& text);

}  // namespace epiline
