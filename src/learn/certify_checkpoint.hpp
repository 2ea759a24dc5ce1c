// The state of an interrupted proof, as it is kept on disk.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "branch_and_bound.hpp"
#include "ricochet/learn/certify.hpp"

namespace ricochet::learn {

/// Number of boxes in which the top of the tree ends.
constexpr std::size_t frontier_boxes = 2048;

/// A level whose proof has started.
struct Started {
    double threshold = 0;
    double lowering = 0;  ///< allowed lowering of the threshold, to include unproved boxes
    Estimate estimate{};
    double seconds = 0;
    std::vector<std::optional<Tally>> done{};  ///< per box of the frontier
};

/// State of the search for a threshold, as failed attempts have changed it.
struct Attempt {
    int number = 0;
    double highest = 0;  ///< highest threshold that could be proved
    double spread = 0;   ///< of the logits, the unit of distances between thresholds
    double closest = 0;  ///< to `highest`
};

struct Progressed {
    std::vector<CertificateLevel> levels{};
    std::vector<Estimate> estimates{};
    std::optional<Attempt> attempt{};  ///< at the level after these
    std::optional<Started> current{};
};

/// Writes to a neighbouring file and renames it. Of a started level the finished parts are
/// kept.
/// @param key  properties in which a proof that continues must agree
/// @throws std::runtime_error naming the file
void save(const Progressed& all, const std::string& key, const std::filesystem::path& file);

/// @throws std::runtime_error naming the file if it cannot be read, is cut short, has been altered,
///         or has another key.
[[nodiscard]] Progressed load(const std::string& key, const std::filesystem::path& file);

}  // namespace ricochet::learn
