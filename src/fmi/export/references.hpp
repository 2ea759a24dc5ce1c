// Value references of an exported model: the time, then states, their rates, parameters, inputs,
// outputs, event indicators, the number of events, the mode.
#pragma once

#include <cstddef>
#include <cstdint>

#include "ricochet/fmi/detail/exported.hpp"

namespace ricochet::fmi::detail {

enum class Quantity : std::uint8_t {
    time,
    state,
    rate,
    parameter,
    input,
    output,
    indicator,
    events,
    mode,
    none,
};

struct Place {
    Quantity quantity = Quantity::none;
    std::size_t index = 0;
};

/// The quantity that a reference is of; `none` for others.
[[nodiscard]] Place place_of(const ModelFacts& facts, std::uint32_t reference);
[[nodiscard]] std::uint32_t reference_of(const ModelFacts& facts, Quantity quantity,
                                         std::size_t index = 0);
[[nodiscard]] std::size_t count_of(const ModelFacts& facts, Quantity quantity);

/// modelDescription.xml. @param version  2 or 3
[[nodiscard]] std::string description(const ModelFacts& facts, int version);
/// Hash of the description without it, as a GUID in braces.
[[nodiscard]] std::string token(const ModelFacts& facts, int version);
/// 64 bits of FNV-1a.
[[nodiscard]] std::uint64_t hash(std::string_view text,
                                 std::uint64_t start = 0xcbf29ce484222325U) noexcept;
/// What a token tells of the model.
[[nodiscard]] std::string_view told_by(std::string_view token) noexcept;

}  // namespace ricochet::fmi::detail
