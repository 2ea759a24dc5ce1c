#include "dense.hpp"

#include <type_traits>

namespace ricochet::learn {

namespace {

const DenseTable& table(InstructionSet set) noexcept
{
    if (set == InstructionSet::x86_64_v4 && dense_v4.single.product) return dense_v4;
    if (set != InstructionSet::baseline && dense_v3.single.product) return dense_v3;
    return dense_baseline;
}

}  // namespace

template <class T>
const DenseKernels<T>& dense_kernels(InstructionSet set) noexcept
{
    if constexpr (std::is_same_v<T, float>) {
        return table(set).single;
    } else {
        return table(set).double_;
    }
}

template const DenseKernels<float>& dense_kernels<float>(InstructionSet) noexcept;
template const DenseKernels<double>& dense_kernels<double>(InstructionSet) noexcept;

}  // namespace ricochet::learn
