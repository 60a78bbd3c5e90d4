#pragma once
// Numerical differentiation for tests of gradients.

namespace epiline::test {

/// Slope of `f` at zero: central differences over h, h/2 and h/4, their errors of second and fourth order taken out.
template <class F>
double slope(F&& f, double h) {
  const auto central = [&](double d) { return (f(d) - f(-d)) / (2 * d); };
  const double a = central(h), b = central(h / 2), c = central(h / 4);
  const double ab = b + (b - a) / 3, bc = c + (c - b) / 3;
  return bc + (bc - ab) / 15;
}

}  // namespace epiline::test
