// Derivatives of formulas along a flow, as formulas.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "formula_code.hpp"

namespace ricochet::python {

/// Appends to the operations of a formula of n components those of the derivative of each along
/// x' = dxdt, t' = 1; the components of dxdt are n to 2 n - 1.
class FormulaRate {
public:
    FormulaRate(std::size_t components, std::span<const FormulaOp> ops)
        : components_(components), count_(ops.size()), ops_(ops.begin(), ops.end())
    {
        for (std::size_t i = 0; i < count_; ++i) slopes_.push_back(slope_of(i));
    }

    /// The operation that is the derivative of an operation of the formula.
    [[nodiscard]] std::size_t derivative(std::size_t of)
    {
        return slopes_[of] ? *slopes_[of] : constant(0);
    }

    /// The operations that one needs, and its place among them.
    [[nodiscard]] std::pair<std::vector<FormulaOp>, std::size_t> only(std::size_t result) const
    {
        std::vector<bool> needed(ops_.size(), false);
        needed[result] = true;
        for (std::size_t i = result + 1; i-- > 0;) {
            if (!needed[i] || is_leaf(ops_[i])) continue;
            needed[ops_[i].a] = true;
            needed[ops_[i].b] = true;
        }
        std::vector<FormulaOp> out;
        std::vector<std::size_t> place(ops_.size());
        for (std::size_t i = 0; i <= result; ++i) {
            if (!needed[i]) continue;
            place[i] = out.size();
            FormulaOp op = ops_[i];
            if (!is_leaf(op)) {
                op.a = place[op.a];
                op.b = place[op.b];
            }
            out.push_back(op);
        }
        return {std::move(out), place[result]};
    }

private:
    using Code = FormulaCode;
    using Slope = std::optional<std::size_t>;  ///< an operation; nothing: zero

    [[nodiscard]] static bool is_leaf(const FormulaOp& op) noexcept
    {
        return op.code <= Code::constant || op.code == Code::parameter;
    }
    std::size_t add(const FormulaOp& op)
    {
        ops_.push_back(op);
        return ops_.size() - 1;
    }
    std::size_t constant(double value) { return add({.code = Code::constant, .value = value}); }
    std::size_t one(Code code, std::size_t a) { return add({.code = code, .a = a}); }
    std::size_t two(Code code, std::size_t a, std::size_t b)
    {
        return add({.code = code, .a = a, .b = b});
    }
    std::size_t times(std::size_t a, std::size_t b) { return two(Code::multiply, a, b); }
    std::size_t square(std::size_t a) { return times(a, a); }
    /// 1 + sign a.
    std::size_t beside_one(Code sign, std::size_t a) { return two(sign, constant(1), a); }

    [[nodiscard]] Slope sum(Code code, const Slope& a, const Slope& b)
    {
        if (!b) return a;
        if (a) return two(code, *a, *b);
        return code == Code::add ? *b : one(Code::negate, *b);
    }
    /// The slope of the operand times a factor.
    template <class Factor>
    [[nodiscard]] Slope scaled(const Slope& slope, const Factor& factor)
    {
        if (!slope) return {};
        return times(*slope, factor());
    }
    template <class Divisor>
    [[nodiscard]] Slope divided(const Slope& slope, const Divisor& divisor)
    {
        if (!slope) return {};
        return two(Code::divide, *slope, divisor());
    }

    [[nodiscard]] Slope slope_of(std::size_t i)
    {
        const FormulaOp op = ops_[i];
        switch (op.code) {
            case Code::component: return add({.code = Code::component, .a = components_ + op.a});
            case Code::time: return constant(1);
            case Code::constant:
            case Code::parameter: return {};
            default: break;
        }
        if (op.code <= Code::hypot) return of_two(op, i, slopes_[op.a], slopes_[op.b]);
        return of_one(op, i, slopes_[op.a]);
    }

    [[nodiscard]] Slope of_two(const FormulaOp& op, std::size_t result, const Slope& a,
                               const Slope& b)
    {
        const auto cross = [&](Code code) {
            return sum(code, scaled(a, [&] { return op.b; }), scaled(b, [&] { return op.a; }));
        };
        switch (op.code) {
            case Code::add:
            case Code::subtract: return sum(op.code, a, b);
            case Code::multiply: return cross(Code::add);
            case Code::divide:
                return divided(sum(Code::subtract, a, scaled(b, [&] { return result; })),
                               [&] { return op.b; });
            case Code::power: return of_power(op, result, a, b);
            case Code::atan2:
                return divided(cross(Code::subtract),
                               [&] { return two(Code::add, square(op.a), square(op.b)); });
            default:  // hypot
                return divided(sum(Code::add, scaled(a, [&] { return op.a; }),
                                   scaled(b, [&] { return op.b; })),
                               [&] { return result; });
        }
    }

    [[nodiscard]] Slope of_power(const FormulaOp& op, std::size_t result, const Slope& a,
                                 const Slope& b)
    {
        const Slope by_base = scaled(a, [&] {
            const std::size_t less = two(Code::subtract, op.b, constant(1));
            return times(op.b, two(Code::power, op.a, less));
        });
        const Slope by_exponent = scaled(b, [&] { return times(one(Code::log, op.a), result); });
        return sum(Code::add, by_base, by_exponent);
    }

    [[nodiscard]] Slope of_one(const FormulaOp& op, std::size_t result, const Slope& a)
    {
        const auto negated = [&](const Slope& slope) -> Slope {
            if (!slope) return {};
            return one(Code::negate, *slope);
        };
        const auto root = [&] { return one(Code::sqrt, beside_one(Code::subtract, square(op.a))); };
        switch (op.code) {
            case Code::negate: return negated(a);
            case Code::sqrt: return divided(a, [&] { return two(Code::add, result, result); });
            case Code::cbrt: return divided(a, [&] { return times(constant(3), square(result)); });
            case Code::exp: return scaled(a, [&] { return result; });
            case Code::log: return divided(a, [&] { return op.a; });
            case Code::sin: return scaled(a, [&] { return one(Code::cos, op.a); });
            case Code::cos: return negated(scaled(a, [&] { return one(Code::sin, op.a); }));
            case Code::tan: return scaled(a, [&] { return beside_one(Code::add, square(result)); });
            case Code::asin: return divided(a, root);
            case Code::acos: return negated(divided(a, root));
            case Code::atan: return divided(a, [&] { return beside_one(Code::add, square(op.a)); });
            case Code::sinh: return scaled(a, [&] { return one(Code::cosh, op.a); });
            case Code::cosh: return scaled(a, [&] { return one(Code::sinh, op.a); });
            default:  // tanh
                return scaled(a, [&] { return beside_one(Code::subtract, square(result)); });
        }
    }

    std::size_t components_;
    std::size_t count_;
    std::vector<FormulaOp> ops_;
    std::vector<Slope> slopes_{};
};

}  // namespace ricochet::python
