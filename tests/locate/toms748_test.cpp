#include "ricochet/locate/locators.hpp"

#include "locators.hpp"

namespace ricochet::test::toms748_test {
namespace {

INSTANTIATE_TYPED_TEST_SUITE_P(Toms748, LocatorSuite, Toms748);

}  // namespace
}  // namespace ricochet::test::toms748_test
