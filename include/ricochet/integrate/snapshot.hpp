// A saved run: everything that its future depends on, as numbers, and the identity of the run.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "ricochet/detail/components.hpp"
#include "ricochet/hybrid/guard.hpp"
#include "ricochet/integrate/options.hpp"
#include "ricochet/integrate/outcome.hpp"

namespace ricochet {

/// A property, as text, in which a run must agree with the run that was saved in order to continue
/// it: {"method", "FixedStep<Euler>"}, {"rtol", "1e-08"}.
struct RunProperty {
    std::string name;
    std::string value;

    [[nodiscard]] bool operator==(const RunProperty&) const = default;
};

/// State of a simulation, as `Simulation::save` returns it: real numbers and other values, in the
/// order in which the simulation lists them.
struct Snapshot {
    std::vector<RunProperty> run;  ///< properties of the run that was saved
    std::vector<double> numbers;
    std::vector<std::uint64_t> counts;

    [[nodiscard]] bool operator==(const Snapshot&) const = default;
};

/// The snapshot as text, its numbers in hexadecimal so that no bit is lost, with a checksum.
[[nodiscard]] std::string to_text(const Snapshot& snapshot);

/// @throws std::invalid_argument if `text` is not exactly what `to_text` has written.
[[nodiscard]] Snapshot snapshot_from_text(std::string_view text);

namespace detail {

/// @throws std::invalid_argument because the snapshot does not fit the simulation.
[[noreturn]] void throw_snapshot_does_not_fit();
/// @throws std::invalid_argument because `what` has a value that no run gives it.
[[noreturn]] void throw_snapshot_is_no_state(std::string_view what);

/// Text that contains the name of a type as the compiler writes it.
template <class T>
[[nodiscard]] constexpr const char* written_type() noexcept
{
    return __PRETTY_FUNCTION__;
}

/// Name of a type without namespaces, the same from every compiler: `Planned<Extremum>`.
[[nodiscard]] std::string plain_type_name(std::string_view written);

/// The name that a system declares, or else the name of its type.
template <class System>
[[nodiscard]] std::string name_of_system(const System& system)
{
    if constexpr (requires {
                      {
                          system.name
                          } -> std::convertible_to<std::string_view>;
                  }) {
        return std::string(std::string_view(system.name));
    } else {
        return plain_type_name(written_type<System>());
    }
}

/// Parts of a run, identified by name.
struct RunParts {
    std::string system;
    std::string stepping, detector, locator;
    std::size_t components = 0;  ///< number of components of the state at the start
    std::size_t guards = 0;
    bool error_controlled = false;
};

[[nodiscard]] std::vector<RunProperty> properties_of_run(const RunParts& parts,
                                                         const Options& options);
/// @throws std::invalid_argument naming the first property that is not the same in both.
void require_same_run(const std::vector<RunProperty>& saved, const std::vector<RunProperty>& here);

/// Whether a flag, a count or an enumerator can have this value.
[[nodiscard]] constexpr bool may_be(Side, std::uint64_t value) noexcept
{
    return value <= static_cast<std::uint64_t>(Side::above);
}
[[nodiscard]] inline bool may_be(Outcome, std::uint64_t value) noexcept
{
    return value < 256 && name(static_cast<Outcome>(value)) != "unknown";
}
template <std::unsigned_integral T>
[[nodiscard]] constexpr bool may_be(T, std::uint64_t value) noexcept
{
    return value <= std::numeric_limits<T>::max();
}

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
        (*this)(static_cast<std::size_t>(x.size()));
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
            const std::uint64_t count = snapshot_->counts[count_++];
            if (!may_be(T{}, count)) throw_snapshot_is_no_state("a flag or a count");
            value = static_cast<T>(count);
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

    /// Checks that everything has been read.
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
