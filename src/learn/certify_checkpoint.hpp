// A proof that was interrupted, as it is kept on disk.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "branch_and_bound.hpp"
#include "ricochet/learn/certify.hpp"

namespace ricochet::learn {

/// Boxes that the top of the tree ends in.
constexpr std::size_t frontier_boxes = 2048;

/// A level that was begun.
struct Begun {
    double threshold = 0;
    double lowering = 0;  ///< of the threshold that is allowed, to take unproved boxes in
    Estimate estimate{};
    double seconds = 0;
    std::vector<std::optional<Tally>> done{};  ///< per box of the frontier
};

/// Where the search for a threshold is: attempts that failed have moved these.
struct Attempt {
    int number = 0;
    double highest = 0;  ///< threshold that could be proved at best
    double spread = 0;   ///< of the logits, what a distance between thresholds is measured in
    double closest = 0;  ///< to `highest`
};

struct Progressed {
    std::vector<CertificateLevel> levels{};
    std::vector<Estimate> estimates{};
    std::optional<Attempt> attempt{};  ///< at the level after these
    std::optional<Begun> current{};
};

/// Writes to a neighbouring file and renames it. Of a level that was begun the finished parts are
/// kept.
/// @param key  what a proof that continues must agree in
/// @throws std::runtime_error naming the file
void save(const Progressed& all, const std::string& key, const std::filesystem::path& file);

/// @throws std::runtime_error naming the file if it cannot be read, is cut short, has been altered,
/// or has
///         another key.
[[nodiscard]] Progressed load(const std::string& key, const std::filesystem::path& file);

}  // namespace ricochet::learn
