// Makes one graphics pipeline and prints what the driver reports of its fragment shader. See tests/support/gpu_compiler.py.
// usage: gpu_statistics vertex.spv fragment.spv BINDING:TYPE...   TYPE: u for a uniform buffer, s for a sampler
#include <vulkan/vulkan.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#define CHECK(x) do { VkResult r_ = (x); if (r_) { fprintf(stderr, "%s -> %d\n", #x, r_); exit(1); } } while (0)
static VkShaderModule load(VkDevice d, const char* f) {
  FILE* p = fopen(f, "rb"); fseek(p, 0, SEEK_END); long n = ftell(p); rewind(p); void* b = malloc(n); fread(b, 1, n, p); fclose(p);
  VkShaderModuleCreateInfo i = {VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, 0, 0, n, b}; VkShaderModule m; CHECK(vkCreateShaderModule(d, &i, 0, &m)); return m;
}
int main(int c, char** v) {
  VkApplicationInfo a = {VK_STRUCTURE_TYPE_APPLICATION_INFO, 0, "isa", 1, "isa", 1, VK_API_VERSION_1_1};
  VkInstanceCreateInfo ic = {VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO, 0, 0, &a}; VkInstance in; CHECK(vkCreateInstance(&ic, 0, &in));
  uint32_t n = 1; VkPhysicalDevice pd; VkResult r = vkEnumeratePhysicalDevices(in, &n, &pd); if (r < 0 || !n) { fprintf(stderr, "no device %d %u\n", r, n); return 1; }
  VkPhysicalDeviceProperties pp; vkGetPhysicalDeviceProperties(pd, &pp); 
  float q = 1; VkDeviceQueueCreateInfo qc = {VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, 0, 0, 0, 1, &q};
  VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR pe = {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_EXECUTABLE_PROPERTIES_FEATURES_KHR, 0, 1};
  const char* ex[] = {"VK_KHR_pipeline_executable_properties"};
  VkPhysicalDeviceFeatures pf = {0};
  VkDeviceCreateInfo dc = {VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, &pe, 0, 1, &qc, 0, 0, 1, ex, &pf}; VkDevice d; CHECK(vkCreateDevice(pd, &dc, 0, &d));
  VkDescriptorSetLayoutBinding b[64]; int nb = 0;
  for (int i = 3; i < c; i++) { int k; char t; sscanf(v[i], "%d:%c", &k, &t); b[nb++] = (VkDescriptorSetLayoutBinding){k, t == 'u' ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER : VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 1, VK_SHADER_STAGE_ALL_GRAPHICS, 0}; }
  VkDescriptorSetLayoutCreateInfo lc = {VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, 0, 0, nb, b}; VkDescriptorSetLayout dl; CHECK(vkCreateDescriptorSetLayout(d, &lc, 0, &dl));
  VkPipelineLayoutCreateInfo plc = {VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, 0, 0, 1, &dl}; VkPipelineLayout pl; CHECK(vkCreatePipelineLayout(d, &plc, 0, &pl));
  VkAttachmentDescription at[4]; VkAttachmentReference ref[4]; int na = 4;
  for (int i = 0; i < na; i++) { at[i] = (VkAttachmentDescription){0, VK_FORMAT_R32G32B32A32_SFLOAT, 1, VK_ATTACHMENT_LOAD_OP_DONT_CARE, VK_ATTACHMENT_STORE_OP_STORE, VK_ATTACHMENT_LOAD_OP_DONT_CARE, VK_ATTACHMENT_STORE_OP_DONT_CARE, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL}; ref[i] = (VkAttachmentReference){i, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL}; }
  VkSubpassDescription sp = {0, VK_PIPELINE_BIND_POINT_GRAPHICS, 0, 0, na, ref};
  VkRenderPassCreateInfo rc = {VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO, 0, 0, na, at, 1, &sp}; VkRenderPass rp; CHECK(vkCreateRenderPass(d, &rc, 0, &rp));
  VkPipelineShaderStageCreateInfo st[2] = {{VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO, 0, 0, VK_SHADER_STAGE_VERTEX_BIT, load(d, v[1]), "main"}, {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO, 0, 0, VK_SHADER_STAGE_FRAGMENT_BIT, load(d, v[2]), "main"}};
  VkPipelineVertexInputStateCreateInfo vi = {VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO};
  VkPipelineInputAssemblyStateCreateInfo ia = {VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO, 0, 0, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST};
  VkViewport vp = {0, 0, 1920, 1080, 0, 1}; VkRect2D sc = {{0, 0}, {1920, 1080}};
  VkPipelineViewportStateCreateInfo vs = {VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO, 0, 0, 1, &vp, 1, &sc};
  VkPipelineRasterizationStateCreateInfo rs = {VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO, .lineWidth = 1};
  VkPipelineMultisampleStateCreateInfo ms = {VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO, .rasterizationSamples = 1};
  VkPipelineColorBlendAttachmentState ba[4]; memset(ba, 0, sizeof ba); for (int i = 0; i < na; i++) ba[i].colorWriteMask = 15;
  VkPipelineColorBlendStateCreateInfo cb = {VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO, .attachmentCount = na, .pAttachments = ba};
  VkGraphicsPipelineCreateInfo gp = {VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO, .flags = VK_PIPELINE_CREATE_CAPTURE_STATISTICS_BIT_KHR, .stageCount = 2, .pStages = st, .pVertexInputState = &vi, .pInputAssemblyState = &ia, .pViewportState = &vs, .pRasterizationState = &rs, .pMultisampleState = &ms, .pColorBlendState = &cb, .layout = pl, .renderPass = rp};
  struct timespec t0, t1; clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t0);
  VkPipeline p; CHECK(vkCreateGraphicsPipelines(d, 0, 1, &gp, 0, &p));
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t1);
  printf("device=%s compile_ms=%.0f\n", pp.deviceName, (t1.tv_sec - t0.tv_sec) * 1e3 + (t1.tv_nsec - t0.tv_nsec) * 1e-6);
  PFN_vkGetPipelineExecutablePropertiesKHR gpe = (void*)vkGetDeviceProcAddr(d, "vkGetPipelineExecutablePropertiesKHR");
  PFN_vkGetPipelineExecutableStatisticsKHR gps = (void*)vkGetDeviceProcAddr(d, "vkGetPipelineExecutableStatisticsKHR");
  VkPipelineInfoKHR pi = {VK_STRUCTURE_TYPE_PIPELINE_INFO_KHR, 0, p}; uint32_t ne = 8; VkPipelineExecutablePropertiesKHR ep[8]; for (int i = 0; i < 8; i++) ep[i] = (VkPipelineExecutablePropertiesKHR){VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_PROPERTIES_KHR};
  CHECK(gpe(d, &pi, &ne, ep));
  for (uint32_t e = 0; e < ne; e++) {
    if (!(ep[e].stages & VK_SHADER_STAGE_FRAGMENT_BIT)) continue;
    VkPipelineExecutableInfoKHR ei = {VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_INFO_KHR, 0, p, e}; uint32_t ns = 64; VkPipelineExecutableStatisticKHR s[64]; for (int i = 0; i < 64; i++) s[i] = (VkPipelineExecutableStatisticKHR){VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_STATISTIC_KHR};
    CHECK(gps(d, &ei, &ns, s));
    for (uint32_t i = 0; i < ns; i++) { printf("%s=", s[i].name); if (s[i].format == VK_PIPELINE_EXECUTABLE_STATISTIC_FORMAT_FLOAT64_KHR) printf("%g", s[i].value.f64); else printf("%llu", (unsigned long long)s[i].value.u64); printf("; "); }
    printf("\n");
  }
  return 0;
}
