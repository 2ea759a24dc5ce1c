// Internal: the declarations of this header may change without notice.
//
// The data of a run by Taylor's method besides the system: the constants of its flow, and the
// current step.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <stdexcept>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/scalar_probe.hpp"
#include "ricochet/detail/system_adapter.hpp"
#include "ricochet/system.hpp"
#include "ricochet/taylor/detail/lazy_tape.hpp"
#include "ricochet/taylor/detail/taylor_series.hpp"
#include "ricochet/taylor/detail/taylor_step.hpp"
#include "ricochet/taylor/detail/taylor_tape.hpp"

namespace ricochet::detail {

[[noreturn]] inline void throw_constant_not_finite(const std::string& name)
{
    throw std::invalid_argument(name + ": a constant of the flow is not finite");
}
[[noreturn]] inline void throw_bad_taylor_order(int order)
{
    throw std::invalid_argument("Taylor: order must be 12, 16 or 20, or 0, got " +
                                std::to_string(order));
}

/// A flow for power series in vectors, whose size is known at run time.
template <class System>
concept VectorFlow = requires(const System& system, Mode mode, const Recorded& t,
                              const std::vector<Recorded>& x, std::vector<Recorded>& dxdt)
{
    system.flow(mode, t, x, dxdt);
}
|| requires(const System& system, const Recorded& t, const std::vector<Recorded>& x,
            std::vector<Recorded>& dxdt)
{
    system.flow(t, x, dxdt);
};
template <class System>
concept ConstantModeCount = requires
{
    std::integral_constant<std::size_t, System::mode_count>{};
};

/// A flow whose operations the compiler can read: a template over its scalar that a constant
/// expression evaluates, for an object that is constructed by default.
template <class System, std::size_t n>
concept ConstantFlow = n >
0 && std::is_default_constructible_v<System> &&
    (ScalarFlow<System, n> || (ModedScalarFlow<System, n> && ConstantModeCount<System>)) &&
    RecordableFlow<System, n>;

/// The same, where flows that are no templates over their scalar are ruled out first.
template <class System, std::size_t n>
concept HasSeries = FlowOfScalars<System, ArraysOf<n>::template Of>&& ConstantFlow<System, n>;

/// The number of tapes that the compiler makes of a flow: one for each mode.
template <class System, std::size_t n>
[[nodiscard]] constexpr std::size_t tape_count() noexcept
{
    if constexpr (!ConstantFlow<System, n>) {
        return 0;
    } else if constexpr (ModedScalarFlow<System, n>) {
        return System::mode_count;
    } else {
        return 1;
    }
}

/// The largest number of operations in these modes, with the inputs.
template <class System, std::size_t n, std::size_t... mode>
[[nodiscard]] constexpr std::size_t most_operations(std::index_sequence<mode...>) noexcept
{
    return std::max(
        {std::size_t{0}, taylor_tape<System, n, static_cast<Mode>(mode)>.ops.size()...});
}

/// With more operations than this the code of one step no longer fits into the caches of a
/// processor, and takes longer than operations that are recorded (measured with up to six bodies
/// that attract each other).
inline constexpr std::size_t most_compiled_ops = 200;

/// A system that may have functions that compute its series, made at run time, and is told of steps
/// that are computed without.
template <class System>
concept SeriesAtRunTime = requires(const System& system, Mode mode, const LazyTape& tape)
{
    system.series().code(mode);
    system.series().is_polynomial(mode);
    system.series().count(mode, tape);
};

/// The number of guards with series of their own, where the size of the state is known.
template <class System, std::size_t n>
[[nodiscard]] constexpr std::size_t guards_with_series() noexcept
{
    if constexpr (ConstantFlow<System, n>) {
        return series_guards<System, n>();
    } else if constexpr (ScalarGuards<System, n>) {
        return fixed_guard_count<System, std::array<double, n>>();
    } else {
        return 0;
    }
}

/// A step of a state of n components (0: sized at run time), and scratch of its size.
template <class System, class X, std::size_t n>
struct TaylorSizes {
    static constexpr std::size_t m = guards_with_series<System, n>();
    static constexpr bool on_series = m > 0;
    using Step = TaylorStep<n, m>;
    struct Room {
        using Array = std::array<double, n>;
        /// States at which guards are evaluated.
        using Guarded = std::conditional_t<fixed_size<X>() == 0, Array, X>;
        Array w, rate;
        Guarded x, there;
    };
};
template <class System, class X>
struct TaylorSizes<System, X, 0> {
    static constexpr bool on_series =
        Guarded<System, X> && ScalarGuardsOn<System, std::vector<Recorded>>;
    using Step = LargeTaylorStep;
    struct Room {
        using Array = std::vector<double>;
        using Guarded = X;
        Array w, rate;
        Guarded x, there;
    };
};

/// A adapter with the operations of the flow and the current step.
///
/// Operations that the compiler has read are unrolled by it. Where it cannot read them, where there
/// are too many, or where those of the object differ from those of an object that is constructed by
/// default, they are recorded here, once for each mode, and executed kind by kind. States in
/// vectors may have another size in each mode, which is known when the mode is entered.
template <class System, class X, std::size_t n>
struct TaylorAdapter : SystemAdapter<System, X> {
    using Sizes = TaylorSizes<System, X, n>;
    using Step = typename Sizes::Step;
    using Room = typename Sizes::Room;
    static constexpr bool on_series = Sizes::on_series;
    static constexpr bool is_constant = [] {
        if constexpr (ConstantFlow<System, n>) {
            return most_operations<System, n>(
                       std::make_index_sequence<tape_count<System, n>()>{}) <= most_compiled_ops;
        }
        return false;
    }();
    static constexpr bool takes_series = [] {
        constexpr bool of_arrays = ScalarFlow<System, n> || ModedScalarFlow<System, n>;
        constexpr bool of_vectors = VectorFlow<System>;
        static_assert(
            n == 0 || of_arrays,
            "ricochet: found no flow that takes Taylor series; expected template <class S> "
            "constexpr void flow([Mode,] const S& t, const std::array<S, n>& x, "
            "std::array<S, n>& dxdt) const");
        static_assert(
            n > 0 || of_vectors,
            "ricochet: found no flow that takes Taylor series; expected template <class S> "
            "void flow([Mode,] const S& t, const std::vector<S>& x, std::vector<S>& dxdt) const");
        return n > 0 ? of_arrays : of_vectors;
    }();

    TaylorAdapter(const System& system, const X& like) : SystemAdapter<System, X>(system, like)
    {
        if constexpr (is_constant) {
            as_compiled_ = read_all(system, std::make_index_sequence<tapes>{});
        }
        if constexpr (n == 0) {
            room.x = room.there = like;
            resize(static_cast<std::size_t>(like.size()));
        } else if constexpr (takes_series) {
            if (!as_compiled_) record_all_modes();
        }
    }

    /// Whether the compiler has unrolled the series of this object.
    [[nodiscard]] bool as_compiled() const noexcept { return as_compiled_; }

    /// @throws std::invalid_argument if there is no such order
    void prepare_order(int order)
    {
        if (order != 0 && order != 12 && order != 16 && order != 20) throw_bad_taylor_order(order);
        given_order = order;
    }

    /// Adapts to a state of another size, where the type does not fix it.
    void resize(std::size_t size) requires(n == 0)
    {
        step.resize(0, 0);  // until all is known, even if the flow throws
        if constexpr (takes_series && !moded) static_cast<void>(recorded(0, size));
        room.w.assign(size, 0);
        room.rate.assign(size, 0);
        copy_state(room.w, room.x);
        copy_state(room.w, room.there);
        step.resize(size, guard_count());
    }

    using Coefficients = TaylorCoefficients<double>;

    /// The coefficients up to an order, or all of them where there are fewer; returns their number.
    int compute(Mode mode, double t, const double* x, const Coefficients& to)
    {
        if constexpr (is_constant) {
            if (as_compiled_) return dispatch(mode, t, x, to, std::make_index_sequence<tapes>{});
        }
        if constexpr (SeriesAtRunTime<System>) {
            const auto& series = this->system().series();
            if (const auto code = series.code(mode)) return code(t, x, to.order, to.x, to.guards);
            series.count(mode, recorded(mode, step.size()));
        }
        if constexpr (takes_series) return recorded(mode, step.size()).compute(t, x, to);
        return to.order;
    }

    /// Whether the motion in a mode is a polynomial, of which `compute` has all coefficients.
    [[nodiscard]] bool is_polynomial(Mode mode)
    {
        if constexpr (is_constant) {
            if (as_compiled_) return polynomial_[mode < tapes ? mode : 0];
        }
        if constexpr (SeriesAtRunTime<System>) {
            const auto& series = this->system().series();
            if (series.code(mode)) return series.is_polynomial(mode);
        }
        if constexpr (takes_series) return recorded(mode, step.size()).is_polynomial();
        return false;
    }

    /// The constants of the operations that the compiler has unrolled, each at its number.
    [[nodiscard]] const auto& constants(std::size_t mode) const noexcept
    {
        return constants_[mode];
    }

    int given_order = 0;
    Step step;
    [[no_unique_address]] std::conditional_t<n == 0, Room, std::tuple<>> room;

private:
    static constexpr std::size_t tapes = is_constant ? tape_count<System, n>() : 0;
    static constexpr bool moded = [] {
        if constexpr (n > 0) return ModedScalarFlow<System, n>;
        return requires(const System& system, Mode mode, const Recorded& t,
                        const std::vector<Recorded>& x, std::vector<Recorded>& dxdt)
        {
            system.flow(mode, t, x, dxdt);
        };
    }();

    // --- operations that are recorded ---

    /// Records the modes of arrays before the first step, so that errors are reported there.
    void record_all_modes() requires(n > 0)
    {
        const std::size_t modes = moded ? mode_count_of(this->system()) : 1;
        for (std::size_t mode = 0; mode < modes; ++mode) {
            static_cast<void>(recorded(static_cast<Mode>(mode), n));
        }
    }

    [[nodiscard]] std::size_t guard_count() const
    {
        if constexpr (n > 0) {
            return Sizes::m;
        } else if constexpr (on_series) {
            return guard_count_of<X>(this->system());
        } else {
            return 0;
        }
    }

    [[nodiscard]] LazyTape& recorded(Mode mode, std::size_t size)
    {
        const std::size_t at = moded ? mode : 0;
        const auto found = recorded_.find(at);
        if (found != recorded_.end() && found->second.states() == size) return found->second;
        LazyTape tape = record(mode, size);
        if (!tape.is_finite()) throw_constant_not_finite(name_of_system(this->system()));
        return recorded_.insert_or_assign(at, std::move(tape)).first->second;
    }

    [[nodiscard]] LazyTape record(Mode mode, std::size_t size) const
    {
        Recording recording;
        std::vector<int> outputs(size + guard_count());
        if constexpr (n > 0) {
            record_into(this->system(), mode, recording, std::array<Recorded, n>{}, outputs);
        } else {
            record_into(this->system(), mode, recording, std::vector<Recorded>(size), outputs);
        }
        return {size, recording, std::move(outputs)};
    }

    // --- operations that the compiler knows ---

    static constexpr std::size_t most_constants =
        most_operations<System, n>(std::make_index_sequence<tapes>{});

    static constexpr auto polynomial_ = []<std::size_t... mode>(std::index_sequence<mode...>)
    {
        return std::array<bool, tapes>{
            polynomial_order(taylor_tape<System, n, static_cast<Mode>(mode)>) <=
            least_taylor_order...};
    }
    (std::make_index_sequence<tapes>{});

    /// False: the operations of this object differ.
    template <std::size_t... mode>
    [[nodiscard]] bool read_all(const System& system, std::index_sequence<mode...>)
    {
        return (... && read<mode>(system));
    }
    template <std::size_t mode>
    [[nodiscard]] bool read(const System& system)
    {
        const auto match =
            read_constants<System, n, static_cast<Mode>(mode)>(system, constants_[mode]);
        if (match == TapeMatch::not_finite) throw_constant_not_finite(name_of_system(system));
        return match == TapeMatch::fits;
    }

    template <std::size_t... mode>
    int dispatch(Mode at, double t, const double* x, Coefficients to, std::index_sequence<mode...>)
    {
        constexpr bool one = sizeof...(mode) == 1;
        static_cast<void>((... || ((one || at == static_cast<Mode>(mode)) &&
                                   compute_in<static_cast<Mode>(mode)>(t, x, to))));
        return to.order;
    }
    template <Mode mode>
    bool compute_in(double t, const double* x, Coefficients& to)
    {
        constexpr int degree = polynomial_order(taylor_tape<System, n, mode>);
        constexpr bool is_polynomial = degree <= least_taylor_order;
        if (is_polynomial) to.order = degree;
        using Series =
            TaylorSeries<taylor_tape<System, n, mode>, is_polynomial ? degree : most_taylor_order>;
        Series::compute(constants_[static_cast<std::size_t>(mode)].data(), t, x, to);
        return true;
    }

    bool as_compiled_ = false;
    std::array<std::array<double, most_constants>, tapes> constants_{};
    std::map<std::size_t, LazyTape> recorded_;  ///< by mode, of its last size
};

}  // namespace ricochet::detail
