#pragma once
// Procedural surfaces: what corners live on. Every texture repeats seamlessly and comes with its mip levels.
#include <cstdint>
#include <vector>

namespace epiline {

enum class Material : std::uint8_t {
  kPaint,      ///< almost blank
  kConcrete,   ///< several octaves of stain, pores
  kBrick,      ///< repeated pattern
  kWood,       ///< planks with grain and knots
  kMetal,      ///< plates with rivets and highlights
  kPosters,    ///< sheets of print on a wall
  kTiles,      ///< repeated pattern, floor
  kMesh,       ///< fine wire, repeated
  kGravel,     ///< fine detail everywhere
  kGrass,      ///< fine detail, smooth patches
  kFacade,     ///< windows: buildings far away
  kMachine,    ///< panels, vents, knobs
  kRibs,       ///< corrugated sheet
  kLandscape,  ///< hills and trees far away
  kCount,
};

/// All materials as 8-bit linear reflectance. Level l of a texture has 2^(kLog2Size - l) texels a side.
class TextureAtlas {
 public:
  static constexpr int kLog2Size = 10, kLevels = 9;
  /// Bytes beyond a row that repeat its beginning: a reader may load four bytes at any texel.
  static constexpr int kRowPadding = 4;

  explicit TextureAtlas(std::uint64_t seed);

  const std::uint8_t* data() const { return data_.data(); }
  /// Byte offset of a material's level 0.
  std::int32_t offset(Material material) const { return static_cast<std::int32_t>(material) * kBytes; }
  /// Byte offset of a level from level 0 of its material.
  static constexpr std::int32_t level_offset(int level) {
    std::int32_t sum = 0;
    for (int l = 0; l < level; ++l) sum += (size(l) + kRowPadding) * size(l);
    return sum;
  }
  static constexpr std::int32_t size(int level) { return 1 << (kLog2Size - level); }
  /// Mean reflectance of a material, 0 to 255.
  double mean(Material material) const;

 private:
  static constexpr std::int32_t kBytes = 1'406'272;
  std::vector<std::uint8_t> data_;
};

}  // namespace epiline
