// A ball above a learned surface in a file, here the plane y = 0.
#include <array>
#include <ricochet/nn/guard_network.hpp>
#include <ricochet/ricochet.hpp>
#include <string>

using namespace ricochet;

namespace {
struct Ball {
    using State = std::array<double, 4>;
    static constexpr bool resets = false;
    GuardNetwork surface;
    template <class S>
    void flow(const S&, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        dxdt = {x[2], x[3], S(0.0), S(-9.81)};
    }
    template <class S>
    S guard(const S&, const std::array<S, 4>& x) const
    {
        return surface(x[0], x[1]);
    }
};
}  // namespace

int main()
{
    Model model;
    model.kind = "guard";
    model.offset = {0, 0};
    model.scale = {1, 1};
    model.domain = {{-1, 1}, {-1, 1}};
    model.layers = {{.inputs = 2, .outputs = 1, .weight = {0, 1}, .bias = {0}}};
    const std::string path = "learned-plane.safetensors";
    save_model(model, path);
    // clang-format off
BLOCK
    // clang-format on
}
