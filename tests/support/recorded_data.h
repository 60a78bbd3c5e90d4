#pragma once
#include <cstdlib>
#include <filesystem>
#include <string>

namespace epiline::test {

/// Path of a file of the recorded data sets: below $EPILINE_DATA, or ../shared/data beside the repository. It may not
/// exist.
inline std::string recorded_data(const std::string& relative) {
  const char* root = std::getenv("EPILINE_DATA");
  const auto beside =
      std::filesystem::path(__FILE__).parent_path().parent_path().parent_path().parent_path() / "shared/data";
  return (root ? std::filesystem::path(root) : beside) / relative;
}

}  // namespace epiline::test
