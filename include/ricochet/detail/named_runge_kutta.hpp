// Internal: what it declares may change without notice.
//
// The methods of `methods.hpp` behind one type.
#pragma once

#include <cstdint>
#include <type_traits>
#include <variant>

#include "ricochet/detail/runge_kutta.hpp"

namespace ricochet {

enum class MethodName : std::uint8_t { euler, rk4, cash_karp54, dopri5, fehlberg78 };

}  // namespace ricochet

namespace ricochet::detail {

/// A `RungeKutta` whose tableau is chosen when it is made; what is a constant there is a function
/// here.
template <class X>
class NamedRungeKutta {
public:
    static constexpr bool estimates_error = true;  ///< unless `error_order()` is 0
    static constexpr bool fsal = true;             ///< where `is_fsal()`
    static constexpr bool has_dense_output = true; ///< where `interpolates()`

    explicit NamedRungeKutta(MethodName name = MethodName::dopri5) : name_(name)
    {
        switch (name) {
            case MethodName::euler: method_.template emplace<0>(); break;
            case MethodName::rk4: method_.template emplace<1>(); break;
            case MethodName::cash_karp54: method_.template emplace<2>(); break;
            case MethodName::dopri5: method_.template emplace<3>(); break;
            case MethodName::fehlberg78: method_.template emplace<4>(); break;
        }
    }

    [[nodiscard]] MethodName name() const noexcept { return name_; }
    [[nodiscard]] int order() const
    {
        return std::visit([](const auto& m) { return m.order_value; }, method_);
    }
    [[nodiscard]] int error_order() const
    {
        return std::visit([](const auto& m) { return m.error_order_value; }, method_);
    }
    [[nodiscard]] bool is_fsal() const noexcept { return name_ == MethodName::dopri5; }
    [[nodiscard]] bool interpolates() const noexcept { return name_ == MethodName::dopri5; }

    template <bool with_error, class Flow>
    void depart(const Flow& flow, const X& like, double h, X& w, X& rate, X& error)
    {
        std::visit(
            [&](auto& m) {
                constexpr bool estimates = std::remove_cvref_t<decltype(m)>::estimates_error;
                m.template depart<with_error && estimates>(flow, like, h, w, rate, error);
            },
            method_);
    }

    void dense(double s, double h, const X& rate, X& w) const
    {
        std::get<RungeKutta<Dopri5Tableau, X>>(method_).dense(s, h, rate, w);
    }

private:
    MethodName name_;
    std::variant<RungeKutta<EulerTableau, X>, RungeKutta<Rk4Tableau, X>,
                 RungeKutta<CashKarp54Tableau, X>, RungeKutta<Dopri5Tableau, X>,
                 RungeKutta<Fehlberg78Tableau, X>>
        method_;
};

}  // namespace ricochet::detail
