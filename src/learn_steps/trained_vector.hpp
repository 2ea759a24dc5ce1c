// Parameters in training: with the moments of Adam and optionally a target copy that follows them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "aligned.hpp"
#include "learn/checkpoint_file.hpp"
#include "learn/dense.hpp"

namespace ricochet::learn {

class TrainedVector {
public:
    /// @param followed  whether to keep a target copy
    TrainedVector(std::size_t n, bool followed)
        : values_(n), first_(n), second_(n), target_(followed ? n : 0)
    {
    }

    [[nodiscard]] std::size_t size() const noexcept { return values_.size(); }
    [[nodiscard]] float* data() noexcept { return values_.data(); }
    [[nodiscard]] const float* data() const noexcept { return values_.data(); }
    [[nodiscard]] const float* target() const noexcept { return target_.data(); }
    void copy_to_target() { target_ = values_; }

    /// Counts a step; `step` is then called for each part of the vector.
    void begin_step() noexcept { ++steps_; }

    /// Moves components `begin` to `begin` + n against the gradient.
    /// @param gradient  of the whole vector, in `parts` summands
    /// @param polyak    rate of the target; 0: it does not move
    void step(std::size_t begin, std::size_t n, const Buffer<float>& gradient, std::size_t parts,
              double rate, double polyak) noexcept
    {
        constexpr double beta1 = 0.9;
        constexpr double beta2 = 0.999;
        const auto k = static_cast<double>(steps_);
        dense_kernels<float>().adam(
            {.parameters = values_.data() + begin,
             .gradient = gradient.data() + begin,
             .parts = parts,
             .part_stride = values_.size(),
             .first = first_.data() + begin,
             .second = second_.data() + begin,
             .target = polyak > 0 ? target_.data() + begin : nullptr,
             .n = n,
             .beta1 = static_cast<float>(beta1),
             .beta2 = static_cast<float>(beta2),
             .epsilon = 1e-8F,
             .rate = static_cast<float>(rate / (1 - std::pow(beta1, k))),
             .root_second = static_cast<float>(1 / std::sqrt(1 - std::pow(beta2, k))),
             .polyak = static_cast<float>(polyak)});
    }

    [[nodiscard]] bool finite() const
    {
        return std::all_of(values_.begin(), values_.end(),
                           [](float x) { return std::isfinite(x); });
    }

    void save(Writer& writer) const
    {
        writer.put(steps_);
        for (const Buffer<float>* list : {&values_, &first_, &second_, &target_}) {
            for (const float value : *list) writer.put(value);
        }
    }

    void load(Reader& reader)
    {
        reader.get(steps_);
        for (Buffer<float>* list : {&values_, &first_, &second_, &target_}) {
            for (float& value : *list) reader.get(value);
        }
    }

private:
    std::uint64_t steps_ = 0;
    Buffer<float> values_, first_, second_, target_;
};

}  // namespace ricochet::learn
