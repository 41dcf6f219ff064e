# CMake reads this file right after each project() when pip builds the packages (CMakeLists.txt beside it names it); colcon never sees it.
# It tells ament where the ROS wheels live, and drops the include directories of the machine that the wheels were made on
# from the imported targets: they do not exist here, and CMake would stop at the first one.
find_package(Python3 REQUIRED COMPONENTS Interpreter)
execute_process(
  COMMAND "${Python3_EXECUTABLE}" -c
    "import pathlib, rosidl_adapter; print(pathlib.Path(rosidl_adapter.__file__).parents[4])"
  OUTPUT_VARIABLE boom_ros_prefix
  OUTPUT_STRIP_TRAILING_WHITESPACE
  COMMAND_ERROR_IS_FATAL ANY
)
message(STATUS "ROS from wheels: ${boom_ros_prefix}")
set(ENV{AMENT_PREFIX_PATH} "${boom_ros_prefix}")
list(PREPEND CMAKE_PREFIX_PATH "${boom_ros_prefix}")

function(boom_drop_missing_include_directories)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(directories ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(directories)
      list(FILTER directories EXCLUDE REGEX "^/opt/python/")
      set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${directories}")
    endif()
  endforeach()
endfunction()
cmake_language(DEFER CALL boom_drop_missing_include_directories)
