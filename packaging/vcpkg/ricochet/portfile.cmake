# An overlay port beside its sources: it builds the tree that it is in.
get_filename_component(SOURCE_PATH "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)

vcpkg_check_features(OUT_FEATURE_OPTIONS FEATURE_OPTIONS
    FEATURES
        faults      RICOCHET_FAULTS
        learn       RICOCHET_LEARN
        learn-steps RICOCHET_LEARN_STEPS
        nonsmooth   RICOCHET_NONSMOOTH
        scene       RICOCHET_SCENE
        sensitivity RICOCHET_SENSITIVITY
)
vcpkg_cmake_configure(
    SOURCE_PATH "${SOURCE_PATH}"
    OPTIONS
        ${FEATURE_OPTIONS}
        -DRICOCHET_C=OFF
        -DRICOCHET_PYTHON=OFF
        -DRICOCHET_BUILD_APP=OFF
        -DRICOCHET_BUILD_EXAMPLES=OFF
        -DRICOCHET_BUILD_TESTS=OFF
)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH lib/cmake/ricochet)
file(REMOVE_RECURSE
    "${CURRENT_PACKAGES_DIR}/debug/include"
    "${CURRENT_PACKAGES_DIR}/debug/share"
    "${CURRENT_PACKAGES_DIR}/share/doc"
)
file(INSTALL "${CMAKE_CURRENT_LIST_DIR}/usage" DESTINATION "${CURRENT_PACKAGES_DIR}/share/${PORT}")
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE" "${SOURCE_PATH}/LICENSE-THIRD-PARTY")
