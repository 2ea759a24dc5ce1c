// Systems with parameters by which runs are differentiated.
#pragma once

#include <span>
#include <type_traits>
#include <vector>

namespace ricochet {

/// A system that is a template over the scalar of its parameters, and their values:
///
///     Family{[](auto p) { return Ball<typename decltype(p)::value_type>{p[0], p[1]}; }, {9.81,
///     0.9}}
///
/// `make` takes a `std::span` of constant numbers of any scalar; the system copies those that it
/// keeps.
template <class Make>
struct Family {
    Make make;
    std::vector<double> values;  ///< of the parameters of the system that is run

    using System = std::remove_cvref_t<std::invoke_result_t<const Make&, std::span<const double>>>;

    [[nodiscard]] System system() const { return make(std::span<const double>(values)); }
};
template <class Make>
Family(Make, std::vector<double>) -> Family<Make>;

}  // namespace ricochet
