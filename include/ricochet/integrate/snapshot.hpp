// A run, saved: everything its future depends on, as numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "ricochet/hybrid/components.hpp"

namespace ricochet {

/// What `Simulation::save` returns. Real numbers and the rest, in the order in which
/// the simulation lists them.
struct Snapshot {
    std::vector<double> numbers;
    std::vector<std::uint64_t> counts;

    [[nodiscard]] bool operator==(const Snapshot&) const = default;
};

/// The snapshot as text, its numbers in hexadecimal so that no bit is lost.
[[nodiscard]] std::string to_text(const Snapshot& snapshot);

/// @throws std::invalid_argument if `text` is not what `to_text` writes.
[[nodiscard]] Snapshot snapshot_from_text(std::string_view text);

namespace detail {

/// @throws std::invalid_argument: the snapshot does not fit the simulation.
[[noreturn]] void throw_snapshot_does_not_fit();

class SnapshotWriter {
public:
    static constexpr bool saves = true;

    explicit SnapshotWriter(Snapshot& snapshot) noexcept : snapshot_(&snapshot) {}

    template <class T>
    void operator()(const T& value)
    {
        if constexpr (std::is_floating_point_v<T>) {
            snapshot_->numbers.push_back(value);
        } else {
            snapshot_->counts.push_back(static_cast<std::uint64_t>(value));
        }
    }

    template <class X>
    void state(const X& x)
    {
        (*this)(x.size());
        for_each_component(x, [&](auto i) { snapshot_->numbers.push_back(x[i]); });
    }

private:
    Snapshot* snapshot_;
};

class SnapshotReader {
public:
    static constexpr bool saves = false;

    explicit SnapshotReader(const Snapshot& snapshot) noexcept : snapshot_(&snapshot) {}

    template <class T>
    void operator()(T& value)
    {
        if constexpr (std::is_floating_point_v<T>) {
            if (number_ == snapshot_->numbers.size()) throw_snapshot_does_not_fit();
            value = snapshot_->numbers[number_++];
        } else {
            if (count_ == snapshot_->counts.size()) throw_snapshot_does_not_fit();
            value = static_cast<T>(snapshot_->counts[count_++]);
        }
    }

    template <class X>
    void state(X& x)
    {
        std::size_t size = 0;
        (*this)(size);
        if (snapshot_->numbers.size() - number_ < size) throw_snapshot_does_not_fit();
        if constexpr (requires { x.resize(0); }) {
            x.resize(static_cast<decltype(x.size())>(size));
        } else {
            if (size != static_cast<std::size_t>(x.size())) throw_snapshot_does_not_fit();
        }
        for_each_component(x, [&](auto i) { (*this)(x[i]); });
    }

    /// Everything has been read.
    void finish() const
    {
        if (number_ != snapshot_->numbers.size() || count_ != snapshot_->counts.size()) {
            throw_snapshot_does_not_fit();
        }
    }

private:
    const Snapshot* snapshot_;
    std::size_t number_ = 0;
    std::size_t count_ = 0;
};

}  // namespace detail

}  // namespace ricochet
